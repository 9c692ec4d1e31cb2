//! `mpirun xtask figures`.

use super::{figures, files, text};
use std::path::Path;
use std::process::Command;

#[test]
fn the_bytes_do_not_depend_on_the_number_of_ranks() {
    let arguments = [
        "dymbo-fig5",
        "mi-table4-[25]",
        "cfwmd-fig1",
        "mpa-fig3-7",
        "--quick",
        "--trials",
        "130",
    ];
    let (alone, shared) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let mut mpirun = Command::new("mpirun");
    // Starts on any machine, as any user.
    for name in [
        "OMPI_ALLOW_RUN_AS_ROOT",
        "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM",
        "OMPI_MCA_rmaps_base_oversubscribe",
    ] {
        mpirun.env(name, "1");
    }
    mpirun.args([
        "-n",
        "2",
        env!("CARGO_BIN_EXE_xtask"),
        "figures",
        "--threads",
        "1",
        "--out",
    ]);
    let Ok(run) = mpirun.arg(shared.path()).args(arguments).output() else {
        println!("skipped: there is no mpirun");
        return;
    };
    figures(alone.path(), &arguments);
    let only = |folder: &Path| {
        let mut files = files(folder);
        files.retain(|name, _| name.ends_with(".csv") || name.ends_with(".svg"));
        files
    };
    assert!(only(alone.path()).len() >= 10);
    assert!(only(alone.path()) == only(shared.path()), "{}", text(&run.stderr));
    // One rank prints.
    let said = text(&run.stdout) + &text(&run.stderr);
    assert_eq!([said.matches("[5/5]").count(), said.matches("5 figures in").count()], [1, 1], "{said}");
    // What is refused ends all ranks.
    let refused = mpirun.arg("--shard=3/2").output().unwrap();
    assert_eq!(text(&refused.stderr).matches("error: ").count(), 1, "{}", text(&refused.stderr));
}
