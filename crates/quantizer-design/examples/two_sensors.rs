//! Two sensors of two bits about one unknown: the design, what it is worth, and decoding with a symbol missing.

use fewbits_core::Observation;
use fewbits_quantizer_design::decoder::MmseDecoder;
use fewbits_quantizer_design::{Scene, Symbol, design};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // A standard normal unknown; the second sensor is the better one.
    let scene = Scene::gaussian_with_deviations(1.0, &[1.0, 0.7])?;
    let best = design::estimation(&scene, 2)?;
    for quantizer in best.quantizers() {
        println!("breakpoints {:.4?}, levels of the cells {:?}", quantizer.breakpoints(), quantizer.labels());
    }
    let report = best.report()?;
    println!("squared error {:.6}, information {:.4} nats", report.mean_squared_error, report.information);
    println!("no code of as many bits is below {:.6}", report.ceo_bound.unwrap_or(0.0));
    println!("certificate: {:?}", report.certificate);

    let sent = best
        .quantizers()
        .iter()
        .map(|q| q.encode(0.9))
        .collect::<Result<Vec<_>, _>>()?;
    let decoder = MmseDecoder::new(&best.system, 16)?;
    let both = [sent[0], sent[1]].map(|level| Observation::Received(Symbol(level)));
    println!("both received: {:?}", decoder.decode(&both)?);
    println!("second erased: {:?}", decoder.decode(&[both[0], Observation::Lost])?);

    // In other units the design is the same, and it can be stored.
    let millimetres = best.rescaled(1000.0, fewbits_quantizer_design::Criterion::MeanSquaredError)?;
    println!("{}", serde_json::to_string(&millimetres.quantizers())?);
    Ok(())
}
