//! Rooms and tables of the simulator GADEN: what is read is what was written, and any text is a room, a table or an error.

use fewbits_diffusion::gaden::{Room, Table};
use fewbits_diffusion::{Boundary, CellKind, Domain, FluxRule, Grid, Source, Steady, Transport};
use proptest::prelude::*;

/// A room of 6 x 4 x 2 cells of 0.5 m whose lowest corner is (-1, 2, 0): a wall, and outlets at both ends in x.
const CORNER: [f64; 3] = [-1.0, 2.0, 0.0];

fn kind([x, y, _]: [usize; 3]) -> u8 {
    match (x, y) {
        (3, 0 | 1) => 1,
        (0 | 5, _) => 2,
        _ => 0,
    }
}

fn room_text() -> String {
    let mut text = String::from("#env_min(m) -1 2 0\n#env_max(m) 2 4 1\n#num_cells 6 4 2\n#cell_size(m) 0.5\n");
    for z in 0..2 {
        for x in 0..6 {
            let line: Vec<String> = (0..4).map(|y| kind([x, y, z]).to_string()).collect();
            text += &(line.join(" ") + " \n");
        }
        text += ";\n";
    }
    text
}

/// The same room, written down as a domain.
fn by_hand() -> Domain {
    let grid = Grid::uniform(&[6, 4, 2], 0.5).unwrap();
    let cell = |i| match kind(grid.place(i)) {
        1 => CellKind::Blocked(Boundary::Closed),
        2 => CellKind::Open(Boundary::Outflow),
        _ => CellKind::Free,
    };
    let cells: Vec<CellKind> = (0..grid.cells()).map(cell).collect();
    Domain::new(grid, &cells, [[Boundary::Closed; 2]; 3]).unwrap()
}

/// Rows of every free cell: its centre in the file's coordinates, and numbers.
fn table_text(domain: &Domain, names: &str, numbers: impl Fn(usize, [f64; 3]) -> Vec<f64>) -> String {
    let mut text = format!("\"Points:0\",\"Points:1\",\"Points:2\",{names}\n");
    for (number, cell) in domain.free().iter().enumerate() {
        let centre = domain.grid().centre(*cell);
        let place: Vec<f64> = (0..3).map(|axis| centre[axis] + CORNER[axis]).collect();
        let entries: Vec<String> = place
            .iter()
            .chain(&numbers(number, centre))
            .map(f64::to_string)
            .collect();
        text += &(entries.join(",") + "\n");
    }
    text
}

#[test]
fn a_room_is_its_domain() {
    let room = Room::parse(&room_text()).unwrap();
    assert_eq!(room.domain().unwrap(), by_hand());
    assert_eq!(room.place([0.0, 2.5, 0.5]), [1.0, 0.5, 0.5]);
}

/// The wind in the file is a potential flow of this domain: freed of divergence it is what was written, through the whole section.
#[test]
fn a_wind_without_divergence_is_kept() {
    let text = "#env_min(m) 0 0 0\n#env_max(m) 2 1 0.5\n#num_cells 4 2 1\n#cell_size(m) 0.5\n2 2\n0 0\n0 0\n2 2\n;\n";
    let room = Room::parse(text).unwrap();
    let domain = room.domain().unwrap();
    let mut wind = String::from("U:0,U:1,U:2,Points:0,Points:1,Points:2\n");
    for cell in domain.free() {
        let [x, y, z] = domain.grid().centre(*cell);
        wind += &format!("0.25,0,0,{x},{y},{z}\n");
    }
    let flow = room.wind(&domain, &Table::parse(&wind).unwrap()).unwrap();
    for velocity in flow.velocities(&domain) {
        assert!((velocity[0] - 0.25).abs() < 1e-9 && velocity[1].abs() < 1e-9, "{velocity:?}");
    }
}

/// The same velocities as a table and as three texts of layers, one per component, are one flow.
#[test]
fn a_wind_by_components_is_that_of_the_table() {
    let (room, domain) = (Room::parse(&room_text()).unwrap(), by_hand());
    let velocity = |[x, y, z]: [usize; 3]| [0.3 + 0.01 * x as f64, 0.02 * y as f64 - 0.01, 0.005 * z as f64];
    let rows =
        table_text(&domain, "U:0,U:1,U:2", |number, _| velocity(domain.grid().place(domain.free()[number])).to_vec());
    let component = |axis: usize| {
        let mut text = String::new();
        for z in 0..2 {
            for x in 0..6 {
                let line: Vec<String> = (0..4).map(|y| velocity([x, y, z])[axis].to_string()).collect();
                text += &(line.join(" ") + " \n");
            }
            text += ";\n";
        }
        text
    };
    let [u, v, w] = [0, 1, 2].map(component);
    let by_components = room.wind_by_components(&domain, [&u, &v, &w]).unwrap();
    assert_eq!(by_components, room.wind(&domain, &Table::parse(&rows).unwrap()).unwrap());
    for (bad, name) in [
        (v.replacen("0.01", "nan", 1), "V"),
        (v.replacen(';', "", 1), "V"),
        (String::new(), "V"),
    ] {
        let error = room
            .wind_by_components(&domain, [&u, &bad, &w])
            .unwrap_err()
            .to_string();
        assert!(error.contains(name), "{error}");
    }
}

/// Concentrations of our own solver, written as tables of two times and read: cell by cell their mean.
#[test]
fn averages_are_the_means_of_what_was_written() {
    let (room, domain) = (Room::parse(&room_text()).unwrap(), by_hand());
    let still = fewbits_diffusion::Flow::still(&domain);
    let source = domain.point([0.9, 0.6, 0.3]).unwrap();
    let transport = Transport::new(domain.clone(), 0.1, &still, 0.0, FluxRule::default()).unwrap();
    let concentration = Steady::new(&transport)
        .unwrap()
        .concentration(&[Source {
            patch: source,
            rate: 1.0,
        }])
        .unwrap();
    let at = |factor: f64| {
        let text = table_text(&domain, "gas", |number, _| vec![concentration[number] * factor]);
        Table::parse(&text).unwrap()
    };
    let mean = room.averaged(&domain, &[at(0.5), at(2.5)], "gas").unwrap();
    for (found, expected) in mean.iter().zip(&concentration) {
        assert!((found.unwrap() - 1.5 * expected).abs() <= 1e-12 * expected);
    }
    // Cells without a row, and rows beyond the room.
    let one = Table::parse("x y z gas\n-0.7 2.2 0.2 3\n-0.8 2.1 0.1 5\n90 90 90 7\n").unwrap();
    let found = room.averaged(&domain, &[one], "gas").unwrap();
    assert_eq!((found[0], found.iter().flatten().count()), (Some(4.0), 1));
}

/// A corridor whose walls are cells, as the simulator writes rooms: the outlet at its end is not on a side of the grid.
#[test]
fn an_outlet_within_walls_lets_the_gas_out() {
    let wall = "1 1 1\n".repeat(5) + ";\n";
    let corridor = "1 1 1\n1 0 1\n1 0 1\n1 2 1\n1 1 1\n;\n";
    let head = "#env_min(m) 0 0 0\n#env_max(m) 2.5 1.5 1.5\n#num_cells 5 3 3\n#cell_size(m) 0.5\n";
    let domain = Room::parse(&format!("{head}{wall}{corridor}{wall}"))
        .unwrap()
        .domain()
        .unwrap();
    assert_eq!(domain.free().len(), 2);
    let still = fewbits_diffusion::Flow::still(&domain);
    let transport = Transport::new(domain.clone(), 0.1, &still, 0.0, FluxRule::default()).unwrap();
    let patch = domain.point([0.75; 3]).unwrap();
    let steady = Steady::new(&transport).unwrap();
    let concentration = steady.concentration(&[Source { patch, rate: 1.0 }]).unwrap();
    // All that is released passes 0.25 m^2 between two centres that are 0.5 m apart.
    assert!((concentration[0] - concentration[1] - 20.0).abs() < 1e-6, "{concentration:?}");
}

#[test]
fn what_is_wrong_is_named() {
    let room = |from: &str, to: &str| Room::parse(&room_text().replacen(from, to, 1)).unwrap_err().to_string();
    assert!(room("#num_cells 6", "#num_cells 8").contains("env_max"));
    assert!(room("#cell_size(m) 0.5", "#cell_size(m) -1").contains("cell_size"));
    assert!(room("2 2 2 2", "2 2 3 2").contains("`3`"));
    assert!(room("2 2 2 2 \n", "").contains("cells"));
    assert!(room("6 4 2", "60000 60000 60000").contains("env_max"));
    let table = |text: &str| Table::parse(text).unwrap_err().to_string();
    assert!(table("a,b\n1,2\n3\n").contains("line 3") && table("a\nx\n").contains("`x` in line 2"));
    assert!(table("").contains("no line"));
    let (room, domain) = (Room::parse(&room_text()).unwrap(), by_hand());
    let wind = room.wind(&domain, &Table::parse("a,b\n1,2\n").unwrap()).unwrap_err();
    assert!(wind.to_string().contains("Points:0"), "{wind}");
    assert!(room.averaged(&domain, &[], "gas").is_err());
}

proptest! {
    /// Any text, and any text with a few characters of a room changed, is a room, a table or an error.
    #[test]
    fn reading_is_total(text in ".{0,200}", at in 0..200_usize, with in "[0-9 ;#.e-]{0,6}") {
        let _ = (Room::parse(&text), Table::parse(&text));
        let own = room_text();
        let at = at.min(own.len());
        let _ = Room::parse(&format!("{}{with}{}", &own[..at], &own[at..]));
    }
}

/// A room and a wind as the simulator itself wrote them; the wind as one table, or as three files that end in `_U`, `_V` and `_W`.
#[test]
#[ignore = "set FEWBITS_GADEN_ROOM and FEWBITS_GADEN_WIND to files of the simulator"]
fn files_of_the_simulator_are_read() {
    let [room, wind] = ["FEWBITS_GADEN_ROOM", "FEWBITS_GADEN_WIND"].map(|name| std::env::var(name).unwrap());
    let read = |path: &str| std::fs::read_to_string(path).unwrap();
    let text = read(&room);
    let room = Room::parse(&text).unwrap();
    let domain = room.domain().unwrap();
    let words = || text.lines().skip(4).flat_map(str::split_whitespace);
    let count = |wanted: &str| words().filter(|word| *word == wanted).count();
    // Of the outlets those on the sides.
    let air = domain.free().len();
    assert!((count("0")..=count("0") + count("2")).contains(&air), "{air}");
    let flow = match wind.strip_suffix("_U") {
        Some(stem) => {
            let [u, v, w] = ["_U", "_V", "_W"].map(|end| read(&format!("{stem}{end}")));
            room.wind_by_components(&domain, [&u, &v, &w]).unwrap()
        }
        None => room.wind(&domain, &Table::parse(&read(&wind)).unwrap()).unwrap(),
    };
    let velocities = flow.velocities(&domain);
    let fastest = velocities.iter().flatten().fold(0.0, |most: f64, v| most.max(v.abs()));
    println!("{:?} cells, {air} of air, up to {fastest} m/s", domain.grid().counts());
    assert!(velocities.len() == air && fastest.is_finite());
}
