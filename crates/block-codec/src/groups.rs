//! Neighbours that belong together, by the bits that they need apart and together.

/// The groups after neighbours were joined as long as two of them save `least` bits: at each step the two that save most.
#[inline(always)]
pub(crate) fn joined<G>(mut groups: Vec<G>, bits: fn(&G) -> f32, least: f32, join: impl Fn(&G, &G) -> G) -> Vec<G> {
    let mut pairs: Vec<G> = groups.windows(2).map(|pair| join(&pair[0], &pair[1])).collect();
    loop {
        let saved = |at: usize| bits(&groups[at]) + bits(&groups[at + 1]) - bits(&pairs[at]);
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
