//! What a figure is, and how it is run.

use crate::arguments::{self, Argument, Cost, Parameter, Quick};
use crate::claim::{Claim, Claims};
use crate::error::Error;
use crate::kept::Kept;
use crate::parameters;
use crate::schema::{self, Field, Table};
use crate::words::in_words;
use fewbits_monte_carlo::{MonteCarlo, Stream};
use fewbits_plot::Plot;
use serde::{Serialize, de::DeserializeOwned};
use serde_json::{Map, Value as Json};
use std::sync::atomic::{AtomicBool, Ordering};

/// What stands above a figure.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct About {
    /// `<system>-<fig|table><number>`, the name of all its files.
    pub id: &'static str,
    /// A few words.
    pub title: &'static str,
    /// What it shows and what to look for, in our words.
    pub caption: &'static str,
    /// Where in the publications it comes from; empty for our own.
    pub source: &'static str,
}

impl About {
    /// A figure's id, its title, and where in the publications it comes from.
    pub const fn of(id: &'static str, title: &'static str, source: &'static str) -> Self {
        Self {
            id,
            title,
            caption: "",
            source,
        }
    }

    /// With this caption.
    #[must_use]
    pub const fn showing(self, caption: &'static str) -> Self {
        Self { caption, ..self }
    }
}

/// Reads a text file of the user's by its name.
pub type ReadFile<'a> = dyn Fn(&str) -> std::io::Result<String> + Sync + 'a;

/// The surroundings of a run: the seed, and who wants to know of progress.
#[derive(Clone, Copy)]
pub struct Context<'a> {
    /// Root of all randomness.
    pub seed: u64,
    /// Told the number of trials just finished.
    pub progress: Option<&'a (dyn Fn(u64) + Sync)>,
    /// Set to stop early.
    pub cancel: Option<&'a AtomicBool>,
    /// Reads a user's file: figures open none themselves.
    pub read: Option<&'a ReadFile<'a>>,
    /// What earlier figures of this run computed.
    pub kept: Option<&'a Kept>,
}

impl Context<'_> {
    /// A run without listeners.
    pub fn new(seed: u64) -> Self {
        Self {
            seed,
            progress: None,
            cancel: None,
            read: None,
            kept: None,
        }
    }

    /// The text of a user's file.
    ///
    /// # Errors
    /// If it cannot be read, or the run has no way to.
    pub fn read(&self, path: &str) -> std::io::Result<String> {
        match self.read {
            Some(read) => read(path),
            None => Err(std::io::Error::new(std::io::ErrorKind::Unsupported, "this run reads no files")),
        }
    }

    /// The random stream of an experiment. Figures that name the same experiment share its truth and noise.
    pub fn stream(&self, experiment: &str) -> Stream {
        Stream::new(self.seed).named(experiment)
    }

    /// A Monte-Carlo run on `stream` that reports progress and can be cancelled.
    pub fn monte_carlo(&self, stream: Stream, trials: u64) -> MonteCarlo<'_> {
        let mut run = MonteCarlo::new(stream, trials);
        (run.progress, run.cancel) = (self.progress, self.cancel);
        run
    }

    /// Ends a long computation that is no Monte-Carlo run where the user asked for it: call it between its pieces.
    ///
    /// # Errors
    /// [`Error::Cancelled`] once the run is cancelled.
    pub fn check(&self) -> Result<(), Error> {
        if self.cancel.is_some_and(|flag| flag.load(Ordering::Relaxed)) {
            return Err(Error::Cancelled);
        }
        Ok(())
    }
}

/// A figure or table of a publication, or one of our own: parameters in, rows out, and the claims they must meet.
///
/// A parameter named `trials` or ending in `_trials` is effort: lowering it leaves the meaning of the figure and skips the
/// claims that need the full count.
pub trait Figure: Sync {
    /// A flat struct whose `Default` is the paper's setting unless [`Figure::defaults`] says otherwise, and whose fields have
    /// documentation and limits:
    /// [`parameters!`](crate::parameters!) writes it.
    type Parameters: Serialize + DeserializeOwned + Argument + Default + Quick + Send + Sync;

    /// `Vec<Row>`, or a struct of such lists (the first is the main table): see [`Table::of`].
    type Tables: Field;

    /// What stands above the figure.
    fn about(&self) -> About;

    /// The paper's setting.
    fn defaults(&self) -> Self::Parameters {
        Self::Parameters::default()
    }

    /// What a run with these parameters needs, roughly: more than a day or 2 GB is refused before it starts.
    fn cost(&self, parameters: &Self::Parameters) -> Cost {
        parameters.cost()
    }

    /// The world that the figure shares with others: these are run one after the other, and results in [`Context::kept`] serve all.
    fn world(&self) -> Option<&'static str> {
        None
    }

    /// Computes the rows. Same parameters and seed, same bytes, on any number of threads.
    ///
    /// # Errors
    /// If a computation fails or the run is cancelled.
    fn run(&self, parameters: &Self::Parameters, context: &Context<'_>) -> Result<Self::Tables, Error>;

    /// Judges the rows beyond what their references say. The default says nothing more.
    fn claims(&self, _: &Self::Parameters, _: &Self::Tables, _: &mut Claims) {}

    /// Draws the rows.
    fn plot(&self, parameters: &Self::Parameters, tables: &Self::Tables) -> Plot;
}

/// What came out of one run.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// The tables, main table first.
    pub tables: Vec<Table>,
    /// The judged claims.
    pub claims: Vec<Claim>,
    /// The picture.
    pub plot: Plot,
}

/// A figure whatever its types: what the registry holds. Implemented by every [`Figure`].
pub trait AnyFigure: Sync {
    /// What stands above the figure.
    fn about(&self) -> About;

    /// The world that the figure shares with others, which are best run one after the other.
    fn world(&self) -> Option<&'static str>;

    /// The parameters with defaults, ranges and meanings.
    fn parameters(&self) -> Vec<Parameter>;

    /// The tables and their columns, main table first, without rows.
    fn tables(&self) -> Vec<Table>;

    /// A run of the defaults, quickened if asked for, with `overrides` (`name`, text) applied on top.
    ///
    /// A list is written `0.5,0.9`, a list of points `0.5:0.1,0.9:0.2` (entries in the order of the point's fields).
    ///
    /// # Errors
    /// If a parameter is unknown or out of range, or the run would be too large.
    fn configure(&self, overrides: &[(String, String)], quick: bool) -> Result<Run<'_>, Error>;

    /// A run with a full set of parameters, as [`Run::parameters`] has it.
    ///
    /// # Errors
    /// If a parameter is refused, or the run would be too large.
    fn with(&self, parameters: Map<String, Json>) -> Result<Run<'_>, Error>;
}

/// The work of a figure with its typed parameters.
type Work<'a> = dyn Fn(&Context<'_>) -> Result<Outcome, Error> + Send + Sync + 'a;

/// A figure with checked parameters, ready to be run.
pub struct Run<'a> {
    /// All parameters.
    pub parameters: Map<String, Json>,
    work: Box<Work<'a>>,
}

impl<'a> Run<'a> {
    /// A run that does this.
    pub fn of(
        parameters: Map<String, Json>,
        work: impl Fn(&Context<'_>) -> Result<Outcome, Error> + Send + Sync + 'a,
    ) -> Self {
        let work = Box::new(work);
        Self { parameters, work }
    }

    /// Computes the rows, judges them and draws them.
    ///
    /// # Errors
    /// If a computation fails or the run is cancelled.
    pub fn outcome(&self, context: &Context<'_>) -> Result<Outcome, Error> {
        (self.work)(context)
    }
}

/// A checked set of parameters.
fn typed<F: Figure>(figure: &F, map: &Map<String, Json>) -> Result<F::Parameters, Error> {
    let id = Figure::about(figure).id;
    let parameters: F::Parameters = parameters::typed(id, map)?;
    let cost = figure.cost(&parameters);
    for (need, limit, unit) in [
        (cost.bytes, Cost::LIMIT.bytes, "bytes"),
        (cost.seconds, Cost::LIMIT.seconds, "seconds on one core"),
    ] {
        if need.is_nan() || need > limit {
            let asked = format!("figure `{id}` would need about {need:.1e} {unit} at these settings");
            return Err(Error::failed(format_args!("{asked}, beyond {limit:.1e}")));
        }
    }
    Ok(parameters)
}

impl<F: Figure> AnyFigure for F {
    fn about(&self) -> About {
        Figure::about(self)
    }

    fn world(&self) -> Option<&'static str> {
        Figure::world(self)
    }

    fn parameters(&self) -> Vec<Parameter> {
        arguments::described::<F::Parameters>(&parameters::map(&self.defaults()))
    }

    fn tables(&self) -> Vec<Table> {
        schema::tables::<F::Tables>()
    }

    fn configure(&self, overrides: &[(String, String)], quick: bool) -> Result<Run<'_>, Error> {
        let figure = Figure::about(self).id;
        let mut start = self.defaults();
        if quick {
            start.quicken();
        }
        let (mut values, described) = (parameters::map(&start), AnyFigure::parameters(self));
        for (name, text) in overrides {
            parameters::set(figure, &mut values, &described, name, text)?;
        }
        self.with(values)
    }

    fn with(&self, parameters: Map<String, Json>) -> Result<Run<'_>, Error> {
        let typed = typed(self, &parameters)?;
        let (defaults, full) = parameters::meaning(&parameters, &parameters::map(&self.defaults()));
        Ok(Run::of(parameters, move |context| {
            let rows = self.run(&typed, context)?;
            let tables = Table::of(&rows)?;
            let mut claims = Claims::about(Figure::about(self).id, defaults, full);
            Figure::claims(self, &typed, &rows, &mut claims);
            claims.compare(&tables);
            let plot = self.plot(&typed, &rows).renamed(in_words);
            let claims = claims.made();
            Ok(Outcome { tables, claims, plot })
        }))
    }
}
