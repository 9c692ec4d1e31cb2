//! The stored form of [`Levels`].

use super::{Cells, Levels};
use crate::cell::Cell;
use crate::noise::Noise;
use fewbits_numerics::error::{ArgumentError, finite, within};
use serde::{Deserialize, Serialize};

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Parts {
    cells: Vec<Weighted>,
    floor: f64,
    log_scale: f64,
    noise: Noise,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Weighted {
    cell: Cell,
    weight: f64,
}

impl From<Levels> for Parts {
    fn from(factor: Levels) -> Self {
        let cells = factor.cells.as_slice();
        Self {
            cells: cells.map(|(cell, weight)| Weighted { cell, weight }).collect(),
            floor: factor.floor,
            log_scale: factor.log_scale,
            noise: factor.noise,
        }
    }
}

impl TryFrom<Parts> for Levels {
    type Error = ArgumentError;

    fn try_from(parts: Parts) -> Result<Self, ArgumentError> {
        within("floor", parts.floor, 0.0, 1.0)?;
        finite("log_scale", parts.log_scale)?;
        for one in &parts.cells {
            within("weight", one.weight, f64::MIN_POSITIVE, 1.0)?;
            within("floor + weight", parts.floor + one.weight, f64::MIN_POSITIVE, 1.0 + 1e-12)?;
        }
        let overlap = |pair: &&[Weighted]| {
            let (left, right) = (&pair[0], &pair[1]);
            let touch = left.cell.upper() == right.cell.lower();
            left.cell.upper() > right.cell.lower() || touch && left.weight == right.weight
        };
        if let Some(pair) = parts.cells.windows(2).find(overlap) {
            let (left, right) = (&pair[0].cell, &pair[1].cell);
            let text = format!("{left:?} before {right:?}");
            return Err(ArgumentError::new("cells", text, "increasing disjoint cells of different weight"));
        }
        let cells: Vec<(Cell, f64)> = parts.cells.into_iter().map(|one| (one.cell, one.weight)).collect();
        let cells = match cells.as_slice() {
            [] => Cells::None,
            [(cell, weight)] => Cells::One(*cell, *weight),
            _ => Cells::Many(cells),
        };
        Ok(Self::of_parts(cells, parts.floor, parts.log_scale, parts.noise.checked()?))
    }
}
