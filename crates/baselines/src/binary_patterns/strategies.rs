//! The thesis's substitutes for an exhaustive search.

use super::information::mean_information;
use fewbits_binary_patterns::Error;
use fewbits_binary_patterns::engine::{grid_bits, sensors_of};
use fewbits_binary_patterns::{Bank, CellGrid, Mask, Source};
use fewbits_numerics::error::refuse;

/// Strategy 2: repeats the masks of a smaller optimal set, in increasing order, until there are `sensors` of them.
///
/// The result need not be close to the optimum of the larger problem: at 18.2 dB, doubling the best eight masks of three bits is 6 %
/// worse than the result of a descent for sixteen.
///
/// # Errors
/// If `masks` is empty or longer than `sensors`.
pub fn tile(masks: &[Mask], sensors: usize) -> Result<Vec<Mask>, Error> {
    if masks.is_empty() || masks.len() > sensors {
        return refuse("masks", format!("{} masks", masks.len()), format!("1 to {sensors} masks"));
    }
    let mut tiled: Vec<Mask> = masks.iter().copied().cycle().take(sensors).collect();
    tiled.sort_unstable();
    Ok(tiled)
}

/// Strategy 3: the masks that minimise equation 5.13, among sets that contain the `forced` ones.
///
/// The information of independent sensors adds, so the best set repeats the single most informative pattern. The search
/// is trivial and the result poor: 1.3 to 2.7 times the optimal error if the Gray basis is forced.
///
/// # Errors
/// If the grid does not have `2^B` cells, a mask is out of range, the noise is not positive, or more masks are forced than there
/// are sensors.
pub fn by_information(
    source: &Source,
    grid: &CellGrid,
    noise_deviation: f64,
    sensors: usize,
    forced: &[Mask],
) -> Result<Vec<Mask>, Error> {
    let bits = grid_bits(grid)?;
    let mut best = (0, f64::NEG_INFINITY);
    for mask in 1..1 << bits {
        let information = mean_information(&Bank::new(*source, sensors_of(&[mask], grid, noise_deviation)?)?);
        // Mirror images and rounding cause ties; the lowest mask is taken.
        if information > best.1 * (1.0 + 1e-12) || best.0 == 0 {
            best = (mask, information);
        }
    }
    if forced.len() > sensors {
        return refuse("forced", format!("{} masks", forced.len()), format!("at most {sensors}"));
    }
    let mut masks = forced.to_vec();
    masks.resize(sensors, best.0);
    masks.sort_unstable();
    Ok(masks)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_keep_the_multiplicities() {
        assert_eq!(tile(&[4, 6, 3], 7).unwrap(), [3, 3, 4, 4, 4, 6, 6]);
        assert!(tile(&[], 3).is_err());
        assert!(tile(&[1, 2], 1).is_err());
    }

    #[test]
    fn information_repeats_one_mask() {
        let source = Source::uniform(1.0).unwrap();
        let grid = CellGrid::uniform(1.0, 3).unwrap();
        let masks = by_information(&source, &grid, source.noise_deviation(20.0).unwrap(), 5, &[4, 6, 3]).unwrap();
        assert_eq!(masks, [1, 1, 3, 4, 6]);
        assert!(by_information(&source, &grid, 0.1, 2, &[4, 6, 3]).is_err());
    }
}
