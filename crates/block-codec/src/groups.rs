//! Neighbours that belong together, by the bits that they need apart and together.

use fewbits_node::elementary::log2;

/// Neighbours, how many they are, how often each of `N` symbols occurs in them, and the bits that they need.
pub(crate) struct Group<const N: usize> {
    pub(crate) size: usize,
    pub(crate) counts: [u32; N],
    bits: f32,
}

/// The sum of these counts, and that of each times its logarithm.
#[inline(always)]
pub(crate) fn sums<const N: usize>(counts: &[u32; N]) -> (f32, f32) {
    let (mut sum, mut terms) = (0, [0.0; N]);
    for (term, count) in terms.iter_mut().zip(counts) {
        let number = (*count).max(1) as f32;
        *term = number * log2(number);
        sum += count;
    }
    (sum as f32, terms.iter().sum())
}

/// The groups after neighbours of so many and with these counts were joined as long as two of them save `least` bits: at each step the two that
/// save most.
#[inline(always)]
pub(crate) fn joined<const N: usize>(
    parts: impl Iterator<Item = (usize, [u32; N])>,
    bits: impl Fn(usize, &[u32; N]) -> f32,
    least: f32,
) -> Vec<Group<N>> {
    let group = |(size, counts)| Group {
        size,
        bits: bits(size, &counts),
        counts,
    };
    let join = |a: &Group<N>, b: &Group<N>| {
        let mut counts = a.counts;
        counts.iter_mut().zip(&b.counts).for_each(|(own, other)| *own += other);
        group((a.size + b.size, counts))
    };
    let mut groups: Vec<Group<N>> = parts.map(group).collect();
    let mut pairs: Vec<Group<N>> = groups.windows(2).map(|pair| join(&pair[0], &pair[1])).collect();
    loop {
        let saved = |at: usize| groups[at].bits + groups[at + 1].bits - pairs[at].bits;
        let best = (0..pairs.len()).max_by(|a, b| saved(*a).total_cmp(&saved(*b)));
        let Some(at) = best.filter(|at| saved(*at) >= least) else {
            return groups;
        };
        groups[at] = pairs.remove(at);
        groups.remove(at + 1);
        for place in at.saturating_sub(1)..(at + 1).min(pairs.len()) {
            pairs[place] = join(&groups[place], &groups[place + 1]);
        }
    }
}
