//! Blocks of standard normal draws.
//!
//! A sequential generator must finish one random word before the next. Here the words come from a counter and a mixing function (SplitMix64
//! with an increment of its own for each source; Steele, Lea and Flood 2014). The words are independent of each other and are
//! computed in vector registers. The ziggurat method (Marsaglia and Tsang 2000, with uniform number and layer from disjoint bits) turns
//! them into draws. The distribution is exact, tails included, and the draws do not depend on the machine's register width.

use super::elementary::{exp, ln};
use super::vectorised;
use rand::{Rng, RngExt};
use std::sync::OnceLock;

/// Random words computed in one pass.
const BLOCK: usize = 256;
const LAYERS: usize = 256;
/// Right edge of the lowest layer, and the area of each (Marsaglia and Tsang 2000, for 256 layers).
const EDGE: f64 = 3.654_152_885_361_009;
const AREA: f64 = 0.004_928_673_233_974_655;

/// Layer edges `x_0 > x_1 = EDGE > ... > x_256 = 0` and the densities `exp(-x^2/2)` there.
struct Ziggurat {
    x: [f64; LAYERS + 1],
    density: [f64; LAYERS + 1],
}

impl Ziggurat {
    /// Whether `y` is below the density at `x`, a place in `layer`, if the line through the ends of the curve in the layer tells.
    ///
    /// The curve is at most `w^2/8 max |f''|` from it, where `w` is the layer's width and `f'' = (x^2 - 1) f`. A hundredth more is for rounding,
    /// which is below a millionth of this distance in every layer.
    #[inline(always)]
    fn squeezed(&self, layer: usize, x: f64, y: f64) -> Option<bool> {
        let (outer, inner) = (self.x[layer], self.x[layer + 1]);
        let (low, high) = (self.density[layer], self.density[layer + 1]);
        let width = outer - inner;
        let bend = (1.0 - inner * inner).abs().max((outer * outer - 1.0).abs()) * high;
        // Times the width, without a division.
        let above = (y - high) * width + (high - low) * (x.abs() - inner);
        (above.abs() > 0.12625 * width * width * width * bend).then_some(above < 0.0)
    }
}

fn ziggurat() -> &'static Ziggurat {
    static TABLE: OnceLock<Ziggurat> = OnceLock::new();
    TABLE.get_or_init(|| {
        let unscaled = |x: f64| exp(-0.5 * x * x);
        let mut x = [0.0; LAYERS + 1];
        // The lowest layer holds the tail: its virtual edge makes a rectangle of the same area.
        x[0] = AREA / unscaled(EDGE);
        x[1] = EDGE;
        for i in 2..LAYERS {
            x[i] = (-2.0 * ln(unscaled(x[i - 1]) + AREA / x[i - 1])).sqrt();
        }
        Ziggurat {
            x,
            density: x.map(unscaled),
        }
    })
}

/// A counter, its odd increment, and the mixing function that makes random words of the counter.
#[derive(Debug, Clone)]
struct Words {
    counter: u64,
    step: u64,
}

impl Words {
    fn seeded<R: Rng + ?Sized>(rng: &mut R) -> Self {
        let step = rng.random::<u64>() | 1;
        // Increments with long runs of equal bits mix badly.
        let even = (step ^ (step >> 1)).count_ones() < 24;
        Self {
            counter: rng.random(),
            step: if even { step ^ 0xaaaa_aaaa_aaaa_aaaa } else { step },
        }
    }

    /// The word at a value of the counter.
    #[inline(always)]
    fn mixed(z: u64) -> u64 {
        let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    #[inline(always)]
    fn next(&mut self) -> u64 {
        self.counter = self.counter.wrapping_add(self.step);
        Self::mixed(self.counter)
    }

    /// Random words, and the uniform numbers of [`split`] in them.
    fn fill(&mut self, words: &mut [u64], uniforms: &mut [f64]) {
        let count = words.len() as u64;
        let Self { counter, step } = *self;
        vectorised(
            #[inline(always)]
            || {
                for (i, (word, uniform)) in words.iter_mut().zip(uniforms).enumerate() {
                    *word = Self::mixed(counter.wrapping_add(step.wrapping_mul(i as u64 + 1)));
                    *uniform = split(*word).1;
                }
            },
        );
        self.counter = counter.wrapping_add(step.wrapping_mul(count));
    }

    /// A uniform number in `(0, 1)`.
    fn uniform(&mut self) -> f64 {
        ((self.next() >> 12) as f64 + 0.5) * f64::EPSILON
    }

    /// A draw, given the proposal `x` in `layer` that is outside the rectangle below the next layer.
    #[cold]
    #[inline(never)]
    fn settled(&mut self, table: &Ziggurat, mut layer: usize, mut x: f64) -> f64 {
        loop {
            if x.abs() < table.x[layer + 1] {
                return x;
            }
            if layer == 0 {
                return self.tail().copysign(x);
            }
            let (low, high) = (table.density[layer], table.density[layer + 1]);
            let y = low + (high - low) * self.uniform();
            if table.squeezed(layer, x, y).unwrap_or_else(|| y < exp(-0.5 * x * x)) {
                return x;
            }
            let (next, uniform) = split(self.next());
            layer = next;
            x = uniform * table.x[layer];
        }
    }

    /// A draw beyond the right edge of the lowest layer (Marsaglia 1964).
    fn tail(&mut self) -> f64 {
        loop {
            let x = -ln(self.uniform()) / EDGE;
            let y = -ln(self.uniform());
            if 2.0 * y > x * x {
                return EDGE + x;
            }
        }
    }
}

/// A source of standard normal draws in blocks, seeded from a random stream.
///
/// ```
/// use fewbits_numerics::kernels::StandardNormals;
/// use rand::SeedableRng;
/// let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(1);
/// let mut noise = vec![0.0; 1000];
/// StandardNormals::new(&mut rng).fill(&mut noise);
/// let mean = noise.iter().sum::<f64>() / 1000.0;
/// assert!(mean.abs() < 0.15);
/// ```
#[derive(Debug, Clone)]
pub struct StandardNormals {
    words: Words,
}

impl StandardNormals {
    /// Seeds the source with two words of `rng`.
    pub fn new<R: Rng + ?Sized>(rng: &mut R) -> Self {
        Self {
            words: Words::seeded(rng),
        }
    }

    /// The state: [`from_state`](Self::from_state) makes a source of it that goes on with the same draws.
    pub fn state(&self) -> [u64; 2] {
        [self.words.counter, self.words.step]
    }

    /// The source of a [`state`](Self::state). `None` if no source has it: its second number is even.
    pub fn from_state([counter, step]: [u64; 2]) -> Option<Self> {
        (step & 1 == 1).then_some(Self {
            words: Words { counter, step },
        })
    }

    /// Fills `out` with independent `N(0, 1)` draws. They depend only on the seed and on the lengths of this and earlier calls.
    pub fn fill(&mut self, out: &mut [f64]) {
        let table = ziggurat();
        let (mut words, mut uniforms) = ([0; BLOCK], [0.0; BLOCK]);
        for block in out.chunks_mut(BLOCK) {
            self.words.fill(&mut words[..block.len()], &mut uniforms);
            // Looking up the table in vector registers would need gathers; a branch that is taken one time in eighty is cheaper.
            for ((z, word), uniform) in block.iter_mut().zip(&words).zip(&uniforms) {
                let layer = layer(*word);
                let x = uniform * table.x[layer];
                *z = if x.abs() < table.x[layer + 1] {
                    x
                } else {
                    self.words.settled(table, layer, x)
                };
            }
        }
    }
}

/// A layer from the low eight bits, a uniform number in `(-1, 1)` from the high 52.
#[inline(always)]
fn split(bits: u64) -> (usize, f64) {
    // A number in [2, 4) less 3, plus half a step of 2^-51: symmetric, never an end.
    let mantissa = f64::from_bits((bits >> 12) | 0x4000_0000_0000_0000);
    (layer(bits), (mantissa - 3.0) + f64::EPSILON)
}

#[inline(always)]
fn layer(bits: u64) -> usize {
    (bits & 0xff) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_splitmix64() {
        // The first outputs of the reference program for the seed 1234567 and the golden step.
        let mut words = Words {
            counter: 1_234_567,
            step: 0x9e37_79b9_7f4a_7c15,
        };
        let mut block = [0; 5];
        words.clone().fill(&mut block, &mut [0.0; 5]);
        assert_eq!(block[..2], [6_457_827_717_110_365_317, 3_203_168_211_198_807_973]);
        assert_eq!(block[2..4], [9_817_491_932_198_370_423, 4_593_380_528_125_082_431]);
        assert_eq!(block[4], 16_408_922_859_458_223_821);
        assert_eq!([(); 5].map(|()| words.next()), block);
    }

    #[test]
    fn a_stored_source_goes_on() {
        let mut source = StandardNormals::new(&mut Stuck(0x0123_4567_89ab_cdef));
        source.fill(&mut [0.0; 1000]);
        let mut again = StandardNormals::from_state(source.state()).expect("its own state");
        let (mut a, mut b) = ([0.0; 700], [1.0; 700]);
        source.fill(&mut a);
        again.fill(&mut b);
        assert_eq!(a, b);
        assert!(StandardNormals::from_state([3, 4]).is_none());
    }

    /// A generator stuck at one word.
    struct Stuck(u64);

    impl rand::TryRng for Stuck {
        type Error = std::convert::Infallible;

        fn try_next_u32(&mut self) -> Result<u32, Self::Error> {
            Ok(self.0 as u32)
        }

        fn try_next_u64(&mut self) -> Result<u64, Self::Error> {
            Ok(self.0)
        }

        fn try_fill_bytes(&mut self, bytes: &mut [u8]) -> Result<(), Self::Error> {
            bytes.fill(self.0 as u8);
            Ok(())
        }
    }

    /// Whatever the seed, steps are odd and change their bits often enough to mix; good ones stay as they are.
    #[test]
    fn steps_mix() {
        for word in [
            0,
            1,
            0xff,
            u64::MAX,
            0xffff_0000_ffff_0000,
            0x0123_4567_89ab_cdef,
            0x9e37_79b9_7f4a_7c15,
        ] {
            let words = Words::seeded(&mut Stuck(word));
            assert_eq!((words.step & 1, words.counter), (1, word));
            assert!((words.step ^ (words.step >> 1)).count_ones() >= 24, "{word:x}");
        }
        assert_eq!(Words::seeded(&mut Stuck(0x9e37_79b9_7f4a_7c14)).step, 0x9e37_79b9_7f4a_7c15);
    }

    #[test]
    fn single_uniforms_are_inside_and_centred() {
        // The extreme words, found backwards through the counter: only the top 52 bits count.
        let mut words = Words {
            counter: 5,
            step: 0x9e37_79b9_7f4a_7c15,
        };
        let (mut sum, mut square) = (0.0, 0.0);
        let count = 20_000;
        for _ in 0..count {
            let expected = ((words.clone().next() >> 12) as f64 + 0.5) / 4_503_599_627_370_496.0;
            let u = words.uniform();
            assert!(u > 0.0 && u < 1.0 && u == expected);
            sum += u;
            square += u * u;
        }
        let n = f64::from(count);
        assert!((sum / n - 0.5).abs() < 4.5 / (12.0 * n).sqrt());
        assert!((square / n - 1.0 / 3.0).abs() < 4.5 * (4.0 / (45.0 * n)).sqrt());
    }

    #[test]
    fn layers_have_equal_areas_and_end_at_zero() {
        let table = ziggurat();
        for i in 1..LAYERS {
            let area = table.x[i] * (table.density[i + 1] - table.density[i]);
            assert!((area / AREA - 1.0).abs() < 1e-9, "layer {i}: {area}");
        }
        let tail = crate::normal::cdf(-EDGE) / crate::normal::INV_SQRT_2PI;
        assert!(((EDGE * table.density[1] + tail) / AREA - 1.0).abs() < 1e-9);
        assert!((table.x[0] * table.density[1] / AREA - 1.0).abs() < 1e-14);
    }

    /// In every layer, also for numbers next to the curve; and the curve itself is needed for few.
    #[test]
    fn the_line_decides_as_the_curve() {
        let table = ziggurat();
        let mut words = Words::seeded(&mut Stuck(0x9e37_79b9_7f4a_7c14));
        let (mut decided, mut count) = (0, 0);
        for layer in 1..LAYERS {
            let (low, high) = (table.density[layer], table.density[layer + 1]);
            for _ in 0..2000 {
                let x = table.x[layer + 1] + (table.x[layer] - table.x[layer + 1]) * words.uniform();
                let curve = exp(-0.5 * x * x);
                let y = low + (high - low) * words.uniform();
                let found = table.squeezed(layer, x, y);
                assert!(found.is_none_or(|below| below == (y < curve)), "layer {layer}, {x}, {y}");
                decided += u32::from(found.is_some());
                count += 1;
                let margin = (high - low) * words.uniform().powi(8);
                for y in [curve, curve - margin, curve + margin] {
                    let found = table.squeezed(layer, -x, y);
                    assert!(found.is_none_or(|below| below == (y < curve)), "layer {layer}, -{x}, {y}");
                }
            }
        }
        assert!(decided * 100 > count * 95, "{decided} of {count}");
    }

    #[test]
    fn uniforms_are_symmetric_and_stay_inside() {
        assert_eq!(split(0).1, -split(u64::MAX).1);
        assert!(split(u64::MAX).1 < 1.0);
        assert_eq!(split(0x1ff).0, 255);
    }
}
