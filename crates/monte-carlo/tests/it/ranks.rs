//! Trials over the ranks of an MPI job.

use fewbits_monte_carlo::mpi::{Threading, initialize_with_threading};
use fewbits_monte_carlo::{Moments, MonteCarlo, MonteCarloError, Stream, Trial};
use rand::RngExt;
use std::convert::Infallible;
use std::process::Command;

/// Lets `mpirun` start on any machine, as any user.
const ANYWHERE: [(&str, &str); 3] = [
    ("OMPI_ALLOW_RUN_AS_ROOT", "1"),
    ("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1"),
    ("OMPI_MCA_rmaps_base_oversubscribe", "1"),
];

#[test]
fn two_and_three_ranks_give_the_bits_of_one_process() {
    for ranks in ["2", "3"] {
        let run = Command::new("mpirun")
            .args(["-n", ranks])
            .arg(std::env::current_exe().unwrap())
            .args(["--exact", "ranks::one_of_several_ranks", "--ignored"])
            .envs(ANYWHERE)
            .output();
        let Ok(run) = run else {
            println!("skipped: there is no mpirun");
            return;
        };
        let said = String::from_utf8_lossy(&run.stdout).into_owned();
        assert!(run.status.success(), "{said}{}", String::from_utf8_lossy(&run.stderr));
        assert_eq!(said.matches("1 passed").count().to_string(), ranks, "{said}");
    }
}

#[test]
#[ignore = "started by the test above under mpirun"]
fn one_of_several_ranks() {
    let (universe, _) = initialize_with_threading(Threading::Funneled).unwrap();
    let ranks = universe.world();
    // The last chunk is not full, and with three ranks one has fewer chunks than the others.
    let run = MonteCarlo::new(Stream::new(9).named("ranks"), 1000);
    let draw = |it: Trial| Ok::<f64, Infallible>(it.stream.rng().random::<f64>().ln());

    let add = |sum: &mut Moments, it: Trial| draw(it).map(|x| sum.add(x));
    let merge = |total: &mut Moments, part: Moments| total.merge(&part);
    let alone = run.fold(Moments::default, add, merge).unwrap();
    assert_eq!(run.fold_over(&ranks, Moments::default, add, merge).unwrap(), alone);
    assert_eq!(run.run_over(&ranks, draw).unwrap(), run.run(draw).unwrap());

    // Every rank reports the failure of lowest index, whichever rank ran it.
    let failing = |it: Trial| {
        if it.index % 300 == 299 {
            Err("as a trial might")
        } else {
            Ok(it.index)
        }
    };
    let error = run.run_over(&ranks, failing).unwrap_err();
    assert!(matches!(error, MonteCarloError::Trial { index: 299, .. }), "{error}");
    assert_eq!(error, run.run(failing).unwrap_err());

    // Results that cannot be written stop every rank.
    let unreadable = run.run_over(&ranks, |_| Ok::<_, Infallible>(WriteOnly)).unwrap_err();
    assert!(matches!(unreadable, MonteCarloError::Exchange { .. }), "{unreadable}");
}

#[derive(Debug)]
struct WriteOnly;

impl serde::Serialize for WriteOnly {
    fn serialize<S: serde::Serializer>(&self, _: S) -> Result<S::Ok, S::Error> {
        Err(serde::ser::Error::custom("cannot be written"))
    }
}

impl<'de> serde::Deserialize<'de> for WriteOnly {
    fn deserialize<D: serde::Deserializer<'de>>(_: D) -> Result<Self, D::Error> {
        Ok(Self)
    }
}
