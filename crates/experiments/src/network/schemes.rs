//! The schemes of the comparison, with their settings and names.

/// How sensors learn the question.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Talk {
    Told,
    Echoed,
}

impl Talk {
    pub(super) fn feedback(self) -> fewbits_protocol::Feedback {
        match self {
            Self::Told => fewbits_protocol::Feedback::Told,
            Self::Echoed => fewbits_protocol::Feedback::Echoed,
        }
    }
}

/// A scheme with its setting.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Scheme {
    /// One-bit sensors under one threshold.
    SignBits { sensors: usize, talk: Talk },
    /// One sensor with a word of the innovation.
    Word { bits: usize, talk: Talk },
    /// All sensors with a word of the innovation.
    Words { bits: usize, talk: Talk },
    /// Censoring sensors; expected messages in a slot, and whether the covariance is shared.
    Censored { messages: f64, shared: bool, talk: Talk },
    /// Every measurement, in single precision or a few bits.
    AllSend { coarse: bool },
    /// Lloyd-Max quantizers and a table.
    LloydMax { levels: usize },
    /// Quantizers designed by mutual information, and a table.
    Information { levels: usize },
    /// One-bit quantizers of patterned cells, and a table.
    Patterned,
    /// Lloyd-Max quantizers into the assumed-density filter.
    Filtered { levels: usize },
    /// A coded mixture from leader to leader.
    Handoff { components: usize, resolution: f64 },
    /// Measurements within a guaranteed error, by sensors that know no model.
    Followed { delta: f64 },
    /// Quantized ranges from far sensors on the axes, which measure about what the others do.
    Ranges { bits: usize, talk: Talk },
}

impl Scheme {
    /// The scheme without its setting.
    pub(super) fn family(&self) -> &'static str {
        match self {
            Self::SignBits { .. } => "Dymbo",
            Self::Word { .. } => "Dymbo-multibit",
            Self::Words { .. } => "innovation-words",
            Self::Censored { shared: false, .. } => "CFwMD",
            Self::Censored { shared: true, .. } => "CFwMD2",
            Self::AllSend { .. } => "all-send",
            Self::LloydMax { .. } => "Lloyd-Max-table",
            Self::Information { .. } => "MI-table",
            Self::Patterned => "patterns-table",
            Self::Filtered { .. } => "Lloyd-Max-filter",
            Self::Handoff { .. } => "hand-off",
            Self::Followed { .. } => "adaptive",
            Self::Ranges { .. } => "quantized-ranges",
        }
    }

    pub(super) fn setting(&self) -> String {
        match self {
            Self::SignBits { sensors, .. } => format!("K={sensors}"),
            Self::Word { bits, .. } | Self::Words { bits, .. } | Self::Ranges { bits, .. } => format!("m={bits}"),
            Self::Followed { delta } => format!("delta={delta}"),
            Self::Censored { messages, .. } => format!("n={messages}"),
            Self::AllSend { coarse } => if *coarse { "few bits" } else { "32 bit" }.to_owned(),
            Self::LloydMax { levels } | Self::Information { levels } | Self::Filtered { levels } => {
                format!("L={levels}")
            }
            Self::Patterned => "K=4".to_owned(),
            Self::Handoff { components, resolution } => format!("M={components} r={resolution}"),
        }
    }

    pub(super) fn talk(&self) -> &'static str {
        match self {
            Self::SignBits { talk, .. }
            | Self::Word { talk, .. }
            | Self::Words { talk, .. }
            | Self::Ranges { talk, .. }
            | Self::Censored { talk, .. } => match talk {
                Talk::Told => "told",
                Talk::Echoed => "echoed",
            },
            Self::AllSend { .. }
            | Self::LloydMax { .. }
            | Self::Information { .. }
            | Self::Patterned
            | Self::Followed { .. }
            | Self::Filtered { .. } => "none",
            Self::Handoff { .. } => "travels",
        }
    }
}

/// The schemes of the scalar world.
pub(super) fn scalar_schemes() -> Vec<Scheme> {
    let mut all = common_schemes();
    for talk in [Talk::Told, Talk::Echoed] {
        all.extend([1, 2, 4].map(|sensors| Scheme::SignBits { sensors, talk }));
        all.extend([2, 3, 4].map(|bits| Scheme::Word { bits, talk }));
    }
    all.extend([2, 4, 8].map(|levels| Scheme::LloydMax { levels }));
    all.extend([2, 4, 8].map(|levels| Scheme::Filtered { levels }));
    all.extend([2, 4].map(|levels| Scheme::Information { levels }));
    all.push(Scheme::Patterned);
    all
}

/// The schemes of the plane.
pub(super) fn plane_schemes() -> Vec<Scheme> {
    let mut all = common_schemes();
    for talk in [Talk::Told, Talk::Echoed] {
        all.extend([1, 2, 3, 4].map(|bits| Scheme::Ranges { bits, talk }));
    }
    all
}

fn common_schemes() -> Vec<Scheme> {
    let mut all = Vec::new();
    for talk in [Talk::Told, Talk::Echoed] {
        all.extend([1, 2, 3, 4].map(|bits| Scheme::Words { bits, talk }));
        for shared in [false, true] {
            all.extend([0.25, 0.5, 1.0, 2.0].map(|messages| Scheme::Censored { messages, shared, talk }));
        }
    }
    all.extend([true, false].map(|coarse| Scheme::AllSend { coarse }));
    all.extend([0.25, 0.5, 1.0, 2.0, 4.0].map(|delta| Scheme::Followed { delta }));
    for components in [1, 3] {
        all.extend([1.0, 0.25].map(|resolution| Scheme::Handoff { components, resolution }));
    }
    all
}
