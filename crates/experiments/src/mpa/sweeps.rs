//! `mpa-table3-mse`, `mpa-fig3-4`, `mpa-fig3-5`, `mpa-table3-low`: all trackers over particles, levels and noise.

use super::scores::{Effort, GAUSSIAN, MSE, Row, clouds, deterministic, ladder, messages, mse, rows};
use super::world::{Method, Point, layouts};
use crate::prelude::*;
use fewbits_baselines::pf_mpa::{Encoder, Reports};

pub struct Mse;

rows! {
    pub struct Mses {
        trackers: Vec<Row> => "Canonical sensors, 50 dB, four levels.",
        speeds: Vec<Row> => "The published encoder for targets of several speeds.",
        layouts: Vec<Row> => "Four other layouts of the sensors.",
        floor: Vec<Row> => "What many particles reach, at three signal-to-noise ratios.",
    }
}

impl Figure for Mse {
    figure!(Effort => Mses, "mpa-table3-mse", "Errors of all trackers", "particle message passing, Section 3.4",
        "Position error at 50 dB with four levels. The interval likelihood on a small grid is a third below Gaussian \
         message passing; particle message passing as published loses the target.");

    fn run(&self, p: &Effort, context: &Context<'_>) -> Result<Mses, Error> {
        let mut methods = deterministic(&[9, 15, 31]);
        for n in [5, 10, 40] {
            methods.extend(clouds(n));
            methods.extend(messages(n)?);
        }
        methods.push(Method::improved(100)?);
        methods.extend(clouds(500));
        let canonical = Point::published(50.0, 4)?;
        let trackers = rows(context, &canonical, &p.of(&methods))?;
        let cheap = p.of(&[&GAUSSIAN[..], &[Method::Guided(40)]].concat());
        let (mut speeds, mut others, mut floor) = (Vec::new(), Vec::new(), Vec::new());
        for speed in [1.0, 1.5, 2.0, 3.0, 4.0] {
            let mut point = canonical.clone();
            (point.name, point.encoder) = (format!("V{speed}"), Encoder::published(speed)?);
            speeds.extend(rows(context, &point, &cheap)?);
        }
        let mut some = deterministic(&[9, 15]);
        for n in [10, 40] {
            some.push(Method::Guided(n));
            some.extend(messages(n)?);
        }
        let effort = Effort {
            trials: p.trials.min(100),
            message_trials: p.message_trials.min(25),
        };
        for (i, sensors) in layouts()?.into_iter().enumerate() {
            let mut point = canonical.clone();
            (point.name, point.sensors) = (format!("layout{i}"), sensors);
            others.extend(rows(context, &point, &effort.of(&some))?);
        }
        let large = [
            Method::Bootstrap(4000, Reports::Levels),
            Method::RaoBlackwell(2000),
            Method::Grid(31),
            Method::GMPA,
        ];
        for snr in [50.0, 40.0, 30.0] {
            floor.extend(rows(context, &Point::published(snr, 4)?, &large.map(|m| (m, p.message_trials)))?);
        }
        Ok(Mses {
            trackers,
            speeds,
            layouts: others,
            floor,
        })
    }

    fn claims(&self, _: &Effort, t: &Mses, claims: &mut Claims) {
        let full = claims.at_full_trials();
        full.keyed("floor-mse", "mean squared position error", &t.floor, |r| r.score.mse);
        let of = |method: &str| find(&t.trackers, &format!("50dB-L4 {method}")).map(|r| &r.score);
        let value = |method: &str| of(method).map(|score| score.mse.value);
        let order = ["grid-15", "guided-40", "GMPA", "GMPA-transfer"].map(value);
        let what =
            "grid < guided draws < Gaussian message passing < the same with transferred velocity (erratum mpa-10)";
        full.increasing("order", what, order);
        let printed = ["improved-40", "GMPA-transfer", "EKF-Q-naive"].map(value);
        let what = "the printed order holds with the naive filter, transferred velocity and errata mended";
        full.increasing("printed-order", what, printed);
        let median = |method: &str| of(method).map(|score| score.median.value);
        let what = "the naive filter's median, too, is above that with quantization noise";
        full.increasing("naive", what, ["EKF-Q", "EKF-Q-naive"].map(median));
        let lost = of("published-40").map(|score| score.lost);
        let what = "as printed, particle message passing loses the target in most tracks (erratum mpa-8)";
        full.at_least("published", what, lost, 0.7);
        let layout = |i: u32, method: &str| mse(&t.layouts, &format!("layout{i} {method}"));
        let what = "the grid is below Gaussian message passing in all layouts";
        full.all("layouts-grid", what, 0..4, |i| {
            over(layout(i, "grid-15"), layout(i, "GMPA")).is_some_and(|r| r < 1.0)
        });
        let what = "improved message passing is at most 1.15 of Gaussian with transfer, in other layouts";
        full.all("layouts-improved", what, 0..4, |i| {
            over(layout(i, "improved-40"), layout(i, "GMPA-transfer")).is_some_and(|r| r <= 1.15)
        });
        let growth = over(mse(&t.speeds, "V4 GMPA"), mse(&t.speeds, "V1.5 GMPA"));
        let what = "the error grows with the square of the speed: a ratio 7.1 of squares gives 5.7";
        full.near("speed", what, growth, 5.7, 0.8);
    }

    fn plot(&self, _: &Effort, t: &Mses) -> Plot {
        let left_out = ["published", "narrow", "EKF-Q-naive", "unquantized", "EKF-U"];
        let mut plot = ladder(select(&t.trackers, |r| !left_out.contains(&r.family)));
        let families = ["EKF-Q", "GMPA", "GMPA-transfer", "guided"];
        let speed = |r: &Row| r.point.trim_start_matches('V').parse().unwrap_or(f64::NAN);
        let lines = families.map(|f| {
            let of = select(&t.speeds, |r| r.family == f);
            Layer::measured(f, of, |r| (speed(r), r.score.mse))
        });
        let x = Axis::linear("speed V / (m/step)").between(0.8, 4.2);
        let speeds = Panel::new("Speed that the encoder expects", x, Axis::log(MSE)).with_all(lines);
        plot.panels.push(speeds);
        Plot::grid(1, plot.panels)
    }
}

/// Marks of the families over a coordinate of the rows.
fn families<'a>(rows: impl Iterator<Item = &'a Row> + Clone, shown: &[&str], x: impl Fn(&Row) -> f64) -> Vec<Layer> {
    let marks = |(i, family): (usize, &&str)| {
        let label = match *family {
            "improved" | "narrow" | "published" => format!("messages, {family}"),
            other => other.to_owned(),
        };
        let of = rows.clone().filter(|r| r.family == *family);
        Layer::measured(label, of, |r| (x(r), r.score.mse)).coloured(i)
    };
    shown.iter().enumerate().map(marks).collect()
}

pub struct Fig34;

const SIZES: [usize; 7] = [3, 5, 10, 20, 40, 100, 500];

impl Figure for Fig34 {
    figure!(Effort => Vec<Row>, "mpa-fig3-4", "Error over the number of particles", "particle message passing, Figure 3.4",
        "40 dB, four levels. Message passing needs forty particles, guided draws ten; neither closes the gap to the filter \
         of unquantized ranges.");

    fn run(&self, p: &Effort, context: &Context<'_>) -> Result<Vec<Row>, Error> {
        let mut methods = deterministic(&[9, 15, 31]);
        for n in SIZES {
            methods.extend(clouds(n));
            match n {
                500 => {}
                100 => methods.push(Method::improved(n)?),
                _ => methods.extend(messages(n)?),
            }
        }
        rows(context, &Point::published(40.0, 4)?, &p.of(&methods))
    }

    fn claims(&self, _: &Effort, t: &Vec<Row>, claims: &mut Claims) {
        let full = claims.at_full_trials();
        // Of three particles the other program loses more tracks.
        full.no_more()
            .keyed("lost-most", "share of lost tracks", t, |r| r.score.lost);
        let value = |method: &str| mse(t, &format!("40dB-L4 {method}"));
        let improved = [10, 20, 40, 100].map(|n| value(&format!("improved-{n}")));
        full.decreasing("improved", "improved message passing gains from particles up to 100", improved);
        full.above("few", "with three particles it loses the target (erratum mpa-9)", value("improved-3"), 4.0);
        let guided = [3, 10, 40, 500].map(|n| value(&format!("guided-{n}")));
        full.decreasing("guided", "guided draws gain, too", guided);
        let enough = over(value("guided-10"), value("guided-500"));
        full.at_most("ten", "ten draws are enough for a guided filter: 1.6 of the error of 500", enough, 1.75);
        let gap = over(value("grid-31"), value("EKF-U"));
        full.above("gap", "the gap to unquantized ranges never closes with four levels", gap, 10.0);
    }

    fn plot(&self, _: &Effort, t: &Vec<Row>) -> Plot {
        let shown = [
            "guided",
            "improved",
            "narrow",
            "published",
            "bootstrap",
            "rao-blackwell",
        ];
        let size = |r: &Row| r.size.unwrap_or(1) as f64;
        let level = |label, method| Layer::level(label, [3.0, 500.0], mse(t, &format!("40dB-L4 {method}")));
        let particles = Axis::log("particles").named(SIZES.map(|n| (n as f64, n.to_string())));
        Plot::of(
            Panel::new("40 dB, four levels", particles, Axis::log(MSE))
                .with_all(families(t.iter(), &shown, size))
                .with(level("grid of 15", "grid-15"))
                .with(level("EKF-U", "EKF-U")),
        )
    }
}

pub struct Fig35;

const LEVELS: [usize; 7] = [2, 4, 8, 16, 32, 64, 256];

impl Figure for Fig35 {
    figure!(Effort => Vec<Row>, "mpa-fig3-5", "Error over the number of levels", "particle message passing, Figure 3.5",
        "50 dB, forty particles, the published encoder. Each bit is worth a factor of about four between two and six bits; \
         what is left at eight bits is the noise.");

    fn defaults(&self) -> Effort {
        Effort {
            trials: 60,
            message_trials: 25,
        }
    }

    fn run(&self, p: &Effort, context: &Context<'_>) -> Result<Vec<Row>, Error> {
        let mut methods = deterministic(&[9, 15, 31]);
        methods.push(Method::Guided(40));
        methods.extend(messages(40)?);
        let mut trackers = Vec::new();
        for levels in LEVELS {
            trackers.extend(rows(context, &Point::published(50.0, levels)?, &p.of(&methods))?);
        }
        Ok(trackers)
    }

    fn claims(&self, _: &Effort, t: &Vec<Row>, claims: &mut Claims) {
        let full = claims.at_full_trials();
        for (method, what) in [
            ("improved-40", "improved message passing"),
            ("GMPA", "Gaussian message passing"),
        ] {
            let values = LEVELS.map(|l| mse(t, &format!("50dB-L{l} {method}")));
            full.decreasing(format!("levels-{method}"), format!("more levels, less error: {what}"), values);
        }
        let slope = over(mse(t, "50dB-L4 GMPA"), mse(t, "50dB-L64 GMPA")).map(|ratio| ratio.powf(0.25));
        full.near("slope", "a bit is worth a factor of about four", slope, 3.4, 0.6);
        let what = "four bits are not nearly unquantized with the published encoder (erratum mpa-13)";
        full.above("four-bits", what, over(mse(t, "50dB-L16 improved-40"), mse(t, "50dB-L16 EKF-U")), 5.0);
        let median = ["EKF-U", "improved-40"].map(|method| find(t, &format!("50dB-L256 {method}")));
        let what = "with eight bits, in the median, still above the unquantized filter";
        full.increasing("eight-bits", what, median.map(|r| r.map(|r| r.score.median.value)));
    }

    fn plot(&self, _: &Effort, t: &Vec<Row>) -> Plot {
        let shown = ["EKF-Q", "GMPA", "GMPA-transfer", "improved", "guided"];
        let bits = |r: &Row| (r.levels as f64).log2();
        let of = |method: &'static str| select(t, move |r| r.method == method);
        Plot::of(
            Panel::semilog("50 dB, forty particles", "bits", MSE)
                .with_all(families(t.iter(), &shown, bits))
                .with(Layer::measured("grid of 15", of("grid-15"), |r| (bits(r), r.score.mse)))
                .with(Layer::dashed("EKF-U", points(of("EKF-U"), |r| (bits(r), r.score.mse.value)))),
        )
    }
}

pub struct Low;

impl Figure for Low {
    figure!(Effort => Vec<Row>, "mpa-table3-low", "Low signal-to-noise ratios", "particle message passing, Section 3.4",
        "30 and 20 dB. More than four levels still help at 30 dB; at 20 dB eight are enough. The printed numbers for `SNR \
         = 30` fit 20 dB.");

    fn run(&self, p: &Effort, context: &Context<'_>) -> Result<Vec<Row>, Error> {
        let mut trackers = Vec::new();
        for snr in [30.0, 20.0] {
            let mut methods = deterministic(&[9, 15, 31]);
            for n in [3, 10, 30] {
                methods.extend(clouds(n));
                methods.extend(messages(n)?);
            }
            methods.extend(clouds(500));
            trackers.extend(rows(context, &Point::published(snr, 4)?, &p.of(&methods))?);
            let cheap = [&GAUSSIAN[..], &[Method::Guided(40)]].concat();
            for levels in [8, 16, 64] {
                trackers.extend(rows(context, &Point::published(snr, levels)?, &p.of(&cheap))?);
            }
        }
        Ok(trackers)
    }

    fn claims(&self, _: &Effort, t: &Vec<Row>, claims: &mut Claims) {
        let full = claims.at_full_trials();
        // Of three particles the other program loses more tracks.
        full.no_more()
            .keyed("lost-most", "share of lost tracks", t, |r| r.score.lost);
        let gmpa = |snr: u32, levels: usize| mse(t, &format!("{snr}dB-L{levels} GMPA"));
        full.decreasing("30dB", "at 30 dB more levels help (erratum mpa-15)", [4, 8, 16, 64].map(|l| gmpa(30, l)));
        let saturated = [16, 64].map(|l| over(gmpa(20, l), gmpa(20, 8)));
        let what = "at 30 dB the unquantized filter is far below the printed .330, which fits 20 dB (erratum mpa-14)";
        full.below("unit", what, mse(t, "30dB-L4 EKF-U"), 0.2);
        full.all("20dB", "at 20 dB nothing is gained beyond eight levels", saturated, |r| r.is_some_and(|r| r > 0.85));
    }

    fn plot(&self, _: &Effort, t: &Vec<Row>) -> Plot {
        let panel = |snr: f64| {
            let here = t.iter().filter(move |r| r.snr_db == snr && r.size != Some(500));
            let shown = ["EKF-U", "EKF-Q", "GMPA", "GMPA-transfer"];
            Panel::loglog(format!("{snr} dB"), "levels", MSE).with_all(families(here, &shown, |r| r.levels as f64))
        };
        Plot::grid(2, vec![panel(30.0), panel(20.0)])
    }
}
