//! A figure that is broken on purpose fails, whatever is broken.

use super::options::Options;
use super::produce::Maker;
use super::record::Record;
use super::select::Job;
use super::write::Directory;
use super::{Ending, ending, summary};
use clap::Parser;
use fewbits_experiments::plot::{Layer, Panel, Plot};
use fewbits_experiments::{About, AnyFigure, Claims, Context, Error, Figure, Verdict, parameters, plotted, rows};
use std::time::Duration;

/// What is wrong with the figure.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Fault {
    Nothing,
    /// A column is computed wrongly.
    Column,
    /// What is claimed is not so.
    Claim,
    /// There are references that no column is compared with.
    Reference,
    /// The world is not the reference's.
    World,
    /// Nothing is seen in the picture.
    Plot,
}

/// `handoff-fig2` in short, by formulas of its own.
struct Narrowing(Fault);

static FIGURES: [Narrowing; 6] = [
    Narrowing(Fault::Nothing),
    Narrowing(Fault::Column),
    Narrowing(Fault::Claim),
    Narrowing(Fault::Reference),
    Narrowing(Fault::World),
    Narrowing(Fault::Plot),
];

parameters! {
    struct Parameters {
        steps: u32 [2..=1000] = 20 => "Steps.",
    }
}

rows! {
    struct Row by "r{ratio}-t{t}" {
        ratio: f64 as panel("ratio {}") => "Ratio of successive standard deviations.",
        t: u32 as x("time t") => "Time.",
        kl_total: f64 ["nat"] as line("from the first density") => "KL from the first density to that of this time.",
        kl_total_reverse: f64 ["nat"] as dashed("to the first density") => "KL the other way round.",
    }
}

/// KL from the normal of deviation `a` to that of deviation `b`.
fn kl(a: f64, b: f64) -> f64 {
    (b / a).ln() + 0.5 * ((a / b).powi(2) - 1.0)
}

impl Figure for Narrowing {
    type Parameters = Parameters;
    type Tables = Vec<Row>;

    fn about(&self) -> About {
        let id = match self.0 {
            Fault::Reference => "handoff-fig3",
            _ => "handoff-fig2",
        };
        About::of(id, "Small losses", "").showing("A Gaussian that is narrowed.")
    }

    fn run(&self, p: &Parameters, _: &Context<'_>) -> Result<Vec<Row>, Error> {
        let late = i32::from(self.0 == Fault::World);
        let row = |ratio: f64, t: u32| {
            let width = ratio.powi(t as i32 + late);
            let share = if self.0 == Fault::Column { 1.001 } else { 1.0 };
            let (kl_total, kl_total_reverse) = (share * kl(1.0, width), kl(width, 1.0));
            Row {
                ratio,
                t,
                kl_total,
                kl_total_reverse,
            }
        };
        let ratios = [0.97, 0.96].into_iter();
        Ok(ratios
            .flat_map(|ratio| (0..=p.steps).map(move |t| (ratio, t)))
            .map(|(ratio, t)| row(ratio, t))
            .collect())
    }

    fn claims(&self, _: &Parameters, rows: &Vec<Row>, claims: &mut Claims) {
        let ten = rows.iter().find(|r| (r.ratio, r.t) == (0.97, 10)).map(|r| r.kl_total);
        match self.0 {
            Fault::Claim => claims.below("ten", "ten steps lose less than 0.1 nat", ten, 0.1),
            _ => claims.above("ten", "ten steps lose more than 0.1 nat", ten, 0.1),
        }
    }

    fn plot(&self, _: &Parameters, rows: &Vec<Row>) -> Plot {
        match self.0 {
            // A logarithmic axis has no place for what is negative.
            Fault::Plot => Plot::of(Panel::semilog("Losses", "t", "KL").with(Layer::line("", vec![(0.0, -1.0)]))),
            _ => plotted(rows, "Losses", &[("", "", &|title, x| Panel::semilog(title, x, "KL / nat"))]),
        }
    }
}

#[derive(Parser)]
struct Line {
    #[command(flatten)]
    options: Options,
}

fn made(figure: &'static Narrowing) -> Record {
    let Line { options } = Line::parse_from(["figures"]);
    let run = figure.configure(&[], false).unwrap();
    let maker = Maker::new(&options).unwrap();
    maker.make(&Job { figure, run }, &|_| ()).unwrap().record
}

#[test]
fn each_of_five_faults_fails_the_gate() {
    let folder = tempfile::tempdir().unwrap();
    let out = Directory::create(folder.path()).unwrap();
    for figure in &FIGURES {
        let (fault, record) = (figure.0, made(figure));
        let failing: Vec<&str> = record
            .claims
            .iter()
            .filter(|claim| claim.verdict == Verdict::Fail)
            .map(|claim| claim.id.as_str())
            .collect();
        let error = record.error.as_deref().unwrap_or_default();
        let is_seen = match fault {
            // Eight references and a claim.
            Fault::Nothing => failing.is_empty() && error.is_empty() && record.count(Verdict::Pass) == 9,
            Fault::Column => failing.iter().all(|id| id.starts_with("kl-total/")) && failing.len() == 4,
            Fault::Claim => failing == ["ten"],
            Fault::Reference => failing == ["l1-references", "probability-references"],
            Fault::World => failing.len() == 8 && failing.iter().any(|id| id.starts_with("kl-total-reverse/")),
            Fault::Plot => failing.is_empty() && error.contains("Losses"),
        };
        assert!(is_seen, "{fault:?}: {failing:?} {error}");
        // The run says which, and fails.
        let records = [record];
        let page = summary::text(&records, out.path(), Duration::ZERO);
        let ending = ending(&out, false, &records, Duration::ZERO);
        let expected = if fault == Fault::Nothing {
            Ending::Good
        } else {
            Ending::Failed
        };
        assert_eq!(ending, expected, "{fault:?}");
        assert_eq!(page.contains("FAIL") || page.contains("failed: "), ending == Ending::Failed, "{fault:?}: {page}");
    }
}
