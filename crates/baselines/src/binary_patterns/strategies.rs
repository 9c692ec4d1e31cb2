//! The thesis's substitutes for an exhaustive search.

use super::information::mean_information;
use fewbits_binary_patterns::Error;
use fewbits_binary_patterns::engine::{grid_bits, sensors_of};
use fewbits_binary_patterns::search::{LinearSearch, MaskSet};
use fewbits_binary_patterns::{Bank, Mask, Source};
use fewbits_numerics::error::refuse;
use fewbits_quantizers::Quantizer;

/// Number of sets that are evaluated on the fine nodes.
const FINALISTS: usize = 16;

/// Strategy 1: the best of all sets that contain the `forced` masks, for instance the Gray basis, as often as they are listed.
///
/// # Errors
/// As [`LinearSearch::ranking`], or if no set contains the masks.
pub fn with_basis(search: &LinearSearch, forced: &[Mask]) -> Result<MaskSet, Error> {
    let times = |masks: &[Mask], mask: Mask| masks.iter().filter(|m| **m == mask).count();
    let contains = |set: &MaskSet| forced.iter().all(|m| times(&set.masks, *m) >= times(forced, *m));
    let mut found: Vec<MaskSet> = search.ranking()?.into_iter().filter(contains).take(FINALISTS).collect();
    for set in &mut found {
        set.mse = search.bank(&set.masks)?.mmse()?;
    }
    // Of equally good sets the one with the lowest masks is taken.
    let least = found.iter().map(|set| set.mse).fold(f64::INFINITY, f64::min);
    let best = found.into_iter().filter(|set| set.mse <= least * (1.0 + 1e-12));
    match best.min_by(|a, b| a.masks.cmp(&b.masks)) {
        Some(best) => Ok(best),
        None => refuse("forced", format!("{forced:?}"), "masks that are in a set of the search"),
    }
}

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
    grid: &Quantizer,
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
    use fewbits_binary_patterns::gray_basis;
    use fewbits_binary_patterns::uniform_cells;

    #[test]
    fn forced_masks_are_kept() {
        let source = Source::uniform(1.0).unwrap();
        let noise = source.noise_deviation(4.0).unwrap();
        let search = LinearSearch::with_deviation(source, uniform_cells(1.0, 3).unwrap(), noise, 5).unwrap();
        let gray = gray_basis(3).unwrap();
        let forced = with_basis(&search, &gray).unwrap();
        assert!(gray.iter().all(|g| forced.masks.contains(g)));
        // The Gray basis and each pair of the seven masks.
        let mut least = f64::INFINITY;
        for (a, b) in (1..8).flat_map(|a| (a..8).map(move |b| (a, b))) {
            let masks = [gray.as_slice(), &[a, b]].concat();
            least = least.min(search.bank(&masks).unwrap().mmse().unwrap());
        }
        assert!((forced.mse / least - 1.0).abs() < 1e-12);
        assert!(with_basis(&search, &[1, 1, 1]).is_ok() && with_basis(&search, &[1, 1, 1, 1]).is_err());
        assert!(with_basis(&search, &[8]).is_err());
    }

    #[test]
    fn tiles_keep_the_multiplicities() {
        assert_eq!(tile(&[4, 6, 3], 7).unwrap(), [3, 3, 4, 4, 4, 6, 6]);
        assert!(tile(&[], 3).is_err());
        assert!(tile(&[1, 2], 1).is_err());
    }

    #[test]
    fn information_repeats_one_mask() {
        let source = Source::uniform(1.0).unwrap();
        let grid = uniform_cells(1.0, 3).unwrap();
        let masks = by_information(&source, &grid, source.noise_deviation(20.0).unwrap(), 5, &[4, 6, 3]).unwrap();
        assert_eq!(masks, [1, 1, 3, 4, 6]);
        assert!(by_information(&source, &grid, 0.1, 2, &[4, 6, 3]).is_err());
    }
}
