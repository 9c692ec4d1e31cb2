//! Probabilities far out, where differences of distribution functions have no digit left.
//!
//! `cargo run -p fewbits-numerics --example far_tails`

use fewbits_numerics::normal;

fn main() {
    println!("{:>6} {:>14} {:>14} {:>12} {:>12}", "from", "1 - cdf", "ln P", "mean", "variance");
    for from in [0.0, 2.0, 6.0, 10.0, 40.0, 1e4] {
        // A standard normal variable known to exceed `from`.
        let naive = 1.0 - normal::cdf(from);
        let above = normal::one_sided(-from);
        let (log_p, mean, variance) = (above.log_probability, above.mean, above.variance);
        println!("{from:>6} {naive:>14.3e} {log_p:>14.6} {mean:>12.6} {variance:>12.3e}");
    }
    let (a, b) = (30.0, 30.001);
    println!("a narrow cell [{a}, {b}): ln P = {:.9}", normal::log_interval(a, b));
}
