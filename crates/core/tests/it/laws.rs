//! Every law holds for an honest implementation, whatever its unit and with no noise at all, and refuses each way of being wrong.

use fewbits_core::columns::{columns_agree, lengths_agree};
use fewbits_core::factor::{Constant, Factor, Tilted, Value};
use fewbits_core::{
    Belief, BitReader, BitWriter, CodecError, Columns, ColumnsMut, Density, Deterministic, Dynamics, Error, FullValue,
    Gaussian, GaussianDynamics, Likelihood, LinearDynamics, Link, Message, NumberFormat, Observation, Scheme, Sensing,
    Sign, laws,
};
use fewbits_monte_carlo::Stream;
use nalgebra::{Matrix2, SVector, Vector1, Vector2};
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

/// What is wrong.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Fault {
    Nothing,
    /// A mean that is not that of the draws.
    Mean,
    /// Too much noise in the second coordinate.
    Noise,
    /// Noise without its correlation.
    Correlation,
    /// A sweep that disagrees with the scalar.
    Sweep,
    /// A Jacobian that is no derivative.
    Jacobian,
    /// Something that is no number.
    NotANumber,
}

/// Dynamics, sensing, a belief and a likelihood in a plane, of any unit and noise.
struct Plane {
    unit: f64,
    noise: f64,
    fault: Fault,
}

const TURN: Matrix2<f64> = Matrix2::new(0.8, -0.6, 0.5, 0.7);
const LOWER: Matrix2<f64> = Matrix2::new(1.0, 0.0, 0.5, 1.0);
const NOISE: Matrix2<f64> = Matrix2::new(1.0, 0.5, 0.5, 1.25);
const HERE: Vector2<f64> = Vector2::new(1.0, -2.0);

impl Plane {
    fn has(&self, fault: Fault) -> bool {
        self.fault == fault
    }

    fn draw<R: Rng + ?Sized>(&self, rng: &mut R, mean: Vector2<f64>) -> Vector2<f64> {
        let z = Vector2::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal));
        let mut noise = LOWER * z;
        if self.has(Fault::Correlation) {
            noise[1] = 1.25_f64.sqrt() * z[1];
        }
        if self.has(Fault::Noise) {
            noise[1] *= 1.2;
        }
        mean + noise * self.unit * self.noise
    }

    fn stated(&self, mut mean: Vector2<f64>) -> Vector2<f64> {
        if self.has(Fault::Mean) {
            mean[1] += 0.1 * self.unit;
        }
        mean
    }

    fn square(&self) -> f64 {
        self.unit * self.unit * self.noise * self.noise
    }
}

impl Dynamics<2> for Plane {
    fn mean(&self, state: &Vector2<f64>) -> Vector2<f64> {
        self.stated(TURN * state)
    }

    fn propagate(&self, rng: &mut dyn Rng, state: &Vector2<f64>) -> Vector2<f64> {
        self.draw(rng, TURN * state)
    }

    fn propagate_columns(&self, rng: &mut dyn Rng, states: ColumnsMut<'_, 2>) {
        let shift = if self.has(Fault::Sweep) { 0.1 * self.unit } else { 0.0 };
        let [x, y] = states;
        for (x, y) in x.iter_mut().zip(y) {
            let next = self.draw(rng, TURN * Vector2::new(*x, *y));
            (*x, *y) = (next[0] + shift, next[1]);
        }
    }
}

impl GaussianDynamics<2> for Plane {
    fn jacobian(&self, _: &Vector2<f64>) -> Matrix2<f64> {
        if self.has(Fault::Jacobian) { TURN * 1.001 } else { TURN }
    }

    fn noise_covariance_at(&self, _: &Vector2<f64>) -> Matrix2<f64> {
        NOISE * self.square()
    }
}

impl LinearDynamics<2> for Plane {
    fn transition(&self) -> &Matrix2<f64> {
        &TURN
    }

    fn noise_covariance(&self) -> &Matrix2<f64> {
        &NOISE
    }
}

impl Sensing<2, 2> for Plane {
    fn mean(&self, state: &Vector2<f64>) -> Vector2<f64> {
        self.stated(TURN * state)
    }

    fn jacobian(&self, state: &Vector2<f64>) -> Matrix2<f64> {
        GaussianDynamics::jacobian(self, state)
    }

    fn noise_covariance_at(&self, _: &Vector2<f64>) -> Matrix2<f64> {
        NOISE * self.square()
    }

    fn sample(&self, rng: &mut dyn Rng, state: &Vector2<f64>) -> Vector2<f64> {
        self.draw(rng, TURN * state)
    }

    fn mean_columns(&self, states: &Columns<'_, 2>, means: ColumnsMut<'_, 2>) {
        for i in 0..states[0].len() {
            let mean = Sensing::mean(self, &Vector2::new(states[0][i], states[1][i]));
            means[0][i] = mean[0];
            means[1][i] = mean[1] * if self.has(Fault::Sweep) { 1.001 } else { 1.0 };
        }
    }
}

impl Belief<2> for Plane {
    fn mean(&self) -> Vector2<f64> {
        self.stated(HERE * self.unit)
    }

    fn covariance(&self) -> Matrix2<f64> {
        NOISE * self.square()
    }

    fn sample_columns<R: Rng + ?Sized>(&self, rng: &mut R, mut states: ColumnsMut<'_, 2>) {
        if !columns_agree(&mut states) {
            return;
        }
        let [x, y] = states;
        for (x, y) in x.iter_mut().zip(y) {
            let point = self.draw(rng, HERE * self.unit);
            (*x, *y) = (point[0], point[1]);
        }
    }
}

impl Density<2> for Plane {
    fn log_density(&self, state: &Vector2<f64>) -> f64 {
        let off = if self.has(Fault::Mean) { 0.1 } else { 0.0 };
        let gaussian = Gaussian::new(HERE * self.unit, NOISE * self.square()).unwrap();
        gaussian.log_pdf(state).unwrap() + off
    }

    fn add_log_densities(&self, states: &Columns<'_, 2>, logs: &mut [f64]) {
        if !lengths_agree(states, logs) {
            return;
        }
        let off = if self.has(Fault::Sweep) { 1e-6 } else { 0.0 };
        for (i, log) in logs.iter_mut().enumerate() {
            *log += self.log_density(&Vector2::new(states[0][i], states[1][i])) + off;
        }
    }
}

impl Likelihood<2> for Plane {
    fn log_likelihood(&self, state: &Vector2<f64>) -> f64 {
        if self.has(Fault::NotANumber) {
            f64::NAN
        } else {
            -state[0].abs()
        }
    }

    fn add_log_likelihoods(&self, states: Columns<'_, 2>, log_weights: &mut [f64]) {
        let factor = if self.has(Fault::Sweep) { 1.0 + 1e-9 } else { 1.0 };
        if lengths_agree(&states, log_weights) {
            log_weights
                .iter_mut()
                .zip(states[0])
                .for_each(|(log, x)| *log -= x.abs() * factor);
        }
    }
}

/// A density that leaves the sweep to the trait.
struct Plain(Gaussian<2>);

impl Belief<2> for Plain {
    fn mean(&self) -> Vector2<f64> {
        *self.0.mean()
    }

    fn covariance(&self) -> Matrix2<f64> {
        *self.0.covariance()
    }

    fn sample_columns<R: Rng + ?Sized>(&self, rng: &mut R, columns: ColumnsMut<'_, 2>) {
        self.0.sample_columns(rng, columns);
    }
}

impl Density<2> for Plain {
    fn log_density(&self, state: &Vector2<f64>) -> f64 {
        self.0.log_pdf(state).unwrap()
    }
}

/// Sweeps that a trait provides are those of its scalar function.
#[test]
fn a_sweep_that_nobody_wrote_is_the_scalar_function() {
    let plain = Plain(Gaussian::new(HERE, NOISE).unwrap());
    let (x, y) = ([0.0, 1.0, -3.0], [2.0, -1.0, 0.5]);
    let mut logs = [0.25, 0.0, -1.0];
    plain.add_log_densities(&[&x, &y], &mut logs);
    for (i, start) in [0.25, 0.0, -1.0].into_iter().enumerate() {
        assert_eq!(logs[i], start + plain.log_density(&Vector2::new(x[i], y[i])));
    }
}

/// Which faults a law refuses; it must take all others.
fn refuses(law: &str, with_noise: bool, faults: &[Fault], check: impl Fn(&Plane) -> Result<(), laws::Violation>) {
    for unit in [1e-4, 1.0, 1e4] {
        for noise in if with_noise { vec![0.5] } else { vec![0.0, 0.5] } {
            for fault in [
                Fault::Nothing,
                Fault::Mean,
                Fault::Noise,
                Fault::Correlation,
                Fault::Sweep,
                Fault::Jacobian,
                Fault::NotANumber,
            ] {
                let silent = noise == 0.0 && matches!(fault, Fault::Noise | Fault::Correlation);
                let found = check(&Plane { unit, noise, fault });
                let expected = faults.contains(&fault) && !silent;
                assert_eq!(found.is_err(), expected, "{law}, {fault:?}, unit {unit}, noise {noise}: {found:?}");
            }
        }
    }
}

#[test]
fn laws_of_dynamics_sensing_and_beliefs_refuse_what_is_wrong() {
    use Fault::{Correlation, Jacobian, Mean, Noise, NotANumber, Sweep};
    let rng = || Stream::new(3).rng();
    let draws = 20_000;
    refuses("dynamics' draws", false, &[Mean, Noise, Correlation, Sweep], |p| {
        laws::dynamics::draws_have_the_law(p, &mut rng(), &(HERE * p.unit), draws)
    });
    refuses("dynamics' Jacobian", false, &[Jacobian], |p| {
        laws::dynamics::jacobian_is_the_derivative(p, &(HERE * p.unit))
    });
    refuses("sensing's sweep and Jacobian", false, &[Sweep, Jacobian], |p| {
        laws::sensing::is_consistent(p, &[HERE * p.unit, Vector2::zeros()])
    });
    refuses("measurements", true, &[Mean, Noise, Correlation], |p| {
        laws::sensing::draws_have_the_law(p, &mut rng(), &(HERE * p.unit), draws)
    });
    refuses("samples", false, &[Mean, Noise, Correlation], |p| {
        laws::belief::samples_have_the_moments(p, &mut rng(), draws)
    });
    refuses("densities", true, &[Mean, Sweep], |p| {
        let wide = Gaussian::new(HERE * p.unit, NOISE * (2.0 * p.square()))
            .unwrap()
            .factored()
            .unwrap();
        laws::belief::density_integrates_to_one(p, &wide, &mut rng(), draws)
    });
    refuses("likelihoods", false, &[Sweep, NotANumber], |p| {
        laws::likelihood::sweep_is_scalar(p, &[HERE, Vector2::new(40.0, 0.0)])
    });
    let linear = |fault| {
        laws::dynamics::is_linear(
            &Plane {
                unit: 1.0,
                noise: 1.0,
                fault,
            },
            &[HERE, Vector2::zeros()],
        )
    };
    assert!(linear(Fault::Nothing).is_ok() && linear(Mean).is_err() && linear(Jacobian).is_err());
    let louder = Plane {
        unit: 1.0,
        noise: 1.1,
        fault: Fault::Nothing,
    };
    assert!(laws::dynamics::is_linear(&louder, &[HERE]).is_err());
}

/// A value whose likelihood or whose moments are off.
struct Off {
    value: Value<1>,
    log: f64,
    tilt: [f64; 3],
}

impl Factor<1> for Off {
    fn log_likelihood(&self, m: &SVector<f64, 1>) -> f64 {
        self.value.log_likelihood(m) + self.log
    }

    fn add_log_likelihoods(&self, means: &Columns<'_, 1>, log_weights: &mut [f64]) {
        self.value.add_log_likelihoods(means, log_weights);
    }

    fn tilted(&self, prior: &Gaussian<1>) -> Result<Tilted<1>, Error> {
        let mut tilted = self.value.tilted(prior)?;
        tilted.log_evidence += self.tilt[0];
        tilted.mean[0] += self.tilt[1] * tilted.covariance[0].sqrt();
        tilted.covariance[0] *= 1.0 + self.tilt[2];
        Ok(tilted)
    }
}

#[test]
fn laws_of_factors_refuse_what_is_wrong() {
    for unit in [1e-4, 1.0, 1e4] {
        let prior = Gaussian::scalar(0.6 * unit, 0.9 * unit * unit).unwrap();
        let off = |log, tilt| Off {
            value: Value::scalar(0.4 * unit, 0.7 * unit * unit).unwrap(),
            log,
            tilt,
        };
        let points = [Vector1::new(0.3 * unit), Vector1::new(-2.0 * unit)];
        let quadrature = |f: &Off| laws::factor::tilted_is_quadrature(f, &prior, 12.0 * unit, 4001, 1e-9);
        let honest = off(0.0, [0.0; 3]);
        laws::factor::is_a_number(&honest, &points).unwrap();
        laws::factor::sweep_is_scalar(&honest, &points).unwrap();
        quadrature(&honest).unwrap();
        for i in 0..3 {
            let mut tilt = [0.0; 3];
            tilt[i] = 1e-7;
            assert!(quadrature(&off(0.0, tilt)).is_err(), "{i}");
        }
        assert!(laws::factor::sweep_is_scalar(&off(1e-9, [0.0; 3]), &points).is_err());
        for nothing in [f64::NAN, f64::INFINITY] {
            assert!(laws::factor::is_a_number(&off(nothing, [0.0; 3]), &points).is_err());
        }
        laws::factor::is_a_number(&off(f64::NEG_INFINITY, [0.0; 3]), &points).unwrap();
    }
}

/// Reports what it makes of a uniform number, whatever is measured, with a factor that may be wrong.
struct Drawn<D, F> {
    draw: D,
    factor: F,
}

impl<R, D, F> Scheme<1> for Drawn<D, F>
where
    R: Message<Format = ()>,
    D: Fn(f64) -> R + Send + Sync,
    F: Fn(&Observation<R>, &Link) -> Result<Constant, Error> + Send + Sync,
{
    type State = ();
    type Feedback = f64;
    type Report = R;
    type Factor = Constant;

    fn feedback_format(&self) -> NumberFormat {
        NumberFormat::Double
    }

    fn report_format(&self) {}

    fn encode(&self, rng: &mut dyn Rng, (): &mut (), _: &Vector1<f64>, _: &f64) -> Result<Option<R>, Error> {
        Ok(Some((self.draw)(rng.random())))
    }

    fn factor(&self, _: &f64, observation: &Observation<R>, link: &Link) -> Result<Constant, Error> {
        (self.factor)(observation, link)
    }
}

/// False: it draws.
impl<D, F> Deterministic<1> for Drawn<D, F> where Self: Scheme<1> {}

/// A coin, reported over a link, with a factor that believes in `heads` and in what it is told about missing reports.
fn coin(
    heads: f64,
    nothing: f64,
    lost: f64,
) -> impl Scheme<1, State = (), Feedback = f64, Report = Sign, Factor = Constant> + Deterministic<1> {
    Drawn {
        draw: |uniform| if uniform < 0.3 { Sign::Above } else { Sign::Below },
        factor: move |observation: &Observation<Sign>, link: &Link| {
            Ok(Constant::new(match observation {
                Observation::Received(Sign::Above) => link.arrival() * heads,
                Observation::Received(Sign::Below) => link.arrival() * (1.0 - heads),
                Observation::Nothing => nothing,
                Observation::Lost => lost,
            })?)
        },
    }
}

#[test]
fn laws_of_schemes_refuse_what_is_wrong() {
    let signs = [Sign::Above, Sign::Below];
    let m = Vector1::new(0.0);
    // Without known losses `Lost` is conditioned on; with them it has its probability.
    for (link, lost) in [
        (Link::lossy(0.2).unwrap(), 1.0),
        (Link::lossy(0.2).unwrap().with_erasure(0.1).unwrap(), 0.1),
    ] {
        let total = |coin: &_| laws::scheme::total_probability(coin, &0.0, &link, signs, &[m]);
        let arrives = link.arrival();
        let with = |coin: &_| laws::scheme::total_probability_with(coin, &0.0, &link, |_| arrives, &[m], 1e-12);
        let honest = |coin: &_| {
            let rng = &mut Stream::new(5).rng();
            laws::scheme::frequencies(coin, &0.0, &link, rng, 40_000, &m, |_| m, signs)
        };
        let right = coin(0.3, 0.2, lost);
        assert!(total(&right).is_ok() && with(&right).is_ok() && honest(&right).is_ok());
        for wrong in [coin(0.3, 0.19, lost), coin(0.3, 0.2, 0.9 * lost)] {
            assert!(total(&wrong).is_err() && with(&wrong).is_err());
        }
        let biased = coin(0.33, 0.2, lost);
        assert!(total(&biased).is_ok() && honest(&biased).is_err());
        assert!(honest(&coin(0.3, 0.25, lost)).is_err());
    }
}

#[test]
fn values_draw_nothing_and_coins_do() {
    let sources = [Stream::new(1).rng(), Stream::new(2).rng()];
    let measurements = [-3.0, 0.0, 1e9].map(Vector1::new);
    let value = FullValue::new(0.4).unwrap();
    laws::scheme::deterministic(&value, &(), &sources, &measurements).unwrap();
    let coin = coin(0.3, 0.2, 1.0);
    assert!(laws::scheme::deterministic(&coin, &0.0, &sources, &measurements).is_err());
}

/// Whether each probability of a link is the share of reports that it is stated for, in words of the laws and by counting.
#[test]
fn links_deliver_as_they_say() {
    for (loss, erasure) in [(0.0, 0.0), (0.2, 0.0), (0.0, 0.3), (0.2, 0.1), (0.5, 0.5), (0.0, 1.0)] {
        let link = Link::lossy(loss).unwrap().with_erasure(erasure).unwrap();
        let lost_given_sent = link.lost_given_sent();
        let honest = coin(0.3, link.loss(), lost_given_sent);
        laws::scheme::total_probability(&honest, &0.0, &link, [Sign::Above, Sign::Below], &[Vector1::new(0.0)])
            .unwrap();
        let rng = &mut Stream::new(8).rng();
        let (draws, mut lost) = (20_000, 0.0);
        for _ in 0..draws {
            let seen = link.transmit(rng, Some(&Sign::Above), &()).unwrap();
            lost += f64::from(u8::from(seen == Observation::Lost)) / f64::from(draws);
        }
        // Where no loss is known, none is seen, and the factor is conditioned on it.
        let stated = if erasure > 0.0 { lost_given_sent } else { 0.0 };
        let error = (stated * (1.0 - stated) / f64::from(draws)).sqrt();
        assert!((lost - stated).abs() <= 4.0 * error + 1e-12, "{link:?}: {lost} for {stated}");
        assert_eq!(Constant::of_delivery(&Observation::<Sign>::Lost, &link), Constant::new(lost_given_sent).unwrap());
    }
}

/// One of three colours, whatever is measured: words of two bits, of which the fourth is no report.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Colour(u64);

impl Message for Colour {
    type Format = ();

    fn encode(&self, (): &(), writer: &mut BitWriter) -> Result<(), CodecError> {
        writer.write(self.0, 2)
    }

    fn decode((): &(), reader: &mut BitReader<'_>) -> Result<Self, CodecError> {
        match reader.read(2)? {
            word @ 0..3 => Ok(Self(word)),
            word => Err(CodecError::Invalid {
                what: "colour",
                value: word.to_string(),
                expected: "0, 1 or 2",
            }),
        }
    }
}

#[test]
fn undecodable_words_count_as_known_losses() {
    let m = [Vector1::new(0.0)];
    let colours = || (0..3).map(Colour);
    let flipping = Link::new(0.1, 0.2).unwrap();
    for link in [flipping, flipping.with_erasure(0.15).unwrap(), Link::PERFECT] {
        // Its factor knows what becomes of words that are no colour, or forgets it.
        let painter = |knows_undecodable_words| Drawn {
            draw: |uniform| Colour((3.0 * uniform) as u64),
            factor: move |observation: &Observation<Colour>, link: &Link| {
                let arrives = |word: u64| {
                    let sent = (0..3).map(|sent| link.word_probability(sent, word, 2) / 3.0);
                    link.arrival() * sent.sum::<f64>()
                };
                Ok(match observation {
                    Observation::Received(Colour(word)) => Constant::new(arrives(*word))?,
                    Observation::Lost if knows_undecodable_words && arrives(3) > 0.0 => {
                        Constant::new(link.erasure() + arrives(3))?
                    }
                    missing => Constant::of_delivery(missing, link),
                })
            },
        };
        let total = |painter: &_| laws::scheme::total_probability(painter, &0.0, &link, colours(), &m);
        total(&painter(true)).unwrap();
        assert_eq!(total(&painter(false)).is_ok(), link.crossover() == 0.0);
        let rng = &mut Stream::new(6).rng();
        laws::scheme::frequencies(&painter(true), &0.0, &link, rng, 40_000, &m[0], |_| m[0], colours()).unwrap();
    }
}

/// A plane turned and pushed along one coordinate, without a sweep of its own.
struct Pushed;

impl Dynamics<2> for Pushed {
    fn mean(&self, state: &Vector2<f64>) -> Vector2<f64> {
        TURN * state
    }

    fn propagate(&self, rng: &mut dyn Rng, state: &Vector2<f64>) -> Vector2<f64> {
        TURN * state + Vector2::new(0.0, rng.random::<f64>())
    }
}

#[test]
fn a_cloud_is_propagated_state_by_state() {
    let mut rng = Stream::new(5).named("cloud").rng();
    let (mut x, mut y) = ([1.3, -0.4, 2.2], [0.7, 0.1, -1.9]);
    let expected: Vec<Vector2<f64>> = x
        .iter()
        .zip(&y)
        .map(|(x, y)| Pushed.propagate(&mut rng, &Vector2::new(*x, *y)))
        .collect();
    Pushed.propagate_columns(&mut Stream::new(5).named("cloud").rng(), [&mut x, &mut y]);
    assert_eq!((0..3).map(|i| Vector2::new(x[i], y[i])).collect::<Vec<_>>(), expected);
}
