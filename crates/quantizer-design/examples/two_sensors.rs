//! Two sensors of two bits about one unknown: the design, what it is worth, and decoding with a symbol missing.

use fewbits_core::{Link, Observation};
use fewbits_quantizer_design::{BitBudget, ObservationModel, Request, Symbol};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // A standard normal unknown; the second sensor is the better one.
    let model = ObservationModel::gaussian_with_deviations(1.0, &[1.0, 0.7])?;
    let solutions = Request::estimation(model, BitBudget::Each(2), Link::PERFECT).run()?;
    let best = solutions.best();
    // Cells, words, squared error, bound and certificate.
    println!("{}", best.table());

    let sent = best.encode(&[0.9, 0.9])?;
    let decoder = best.decoder(16)?;
    let both = [sent[0], sent[1]].map(|word| Observation::Received(Symbol(word)));
    println!("both received: {:?}", decoder.decode(&both)?);
    println!("second erased: {:?}", decoder.decode(&[both[0], Observation::Lost])?);

    println!("{}", best.export("two_sensors", 1024)?.to_json()?);
    Ok(())
}
