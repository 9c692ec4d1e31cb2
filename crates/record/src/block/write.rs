//! Encoding of a block.

use super::read::{Head, decode_content, front};
use super::{
    APART, BOUND_FOLLOWS, Cells, DESCRIPTORS_FOLLOW, OTHERS_FOLLOW, ROWS_FOLLOW, SHARED_COLUMNS, SPECIALS_FOLLOW,
    aligned, plain, shared,
};
use crate::codec::{self, CodecId, Context};
use crate::header::Header;
use crate::related;
use crate::specials::{self, Special, Specials};
use crate::time::{self, TimeKind};
use crate::wire::{Bytes, checked, flag, push_varint, written};
use fewbits_block_codec::Effort;

struct CodedColumn {
    descriptor: u8,
    /// The bound and the numbers of other columns.
    head: Vec<u8>,
    bytes: Vec<u8>,
    /// Indices on the start's grid, for the shared code.
    indices: Option<Vec<i64>>,
    specials: Specials,
    restored: Cells,
}

/// Encodes one column of a block. `before` are the columns before it as a reader will restore them.
fn encode_column(
    header: &Header,
    cells: &[Option<f64>],
    own: Option<f64>,
    before: &[Cells],
    effort: Effort,
    may_share: bool,
) -> CodedColumn {
    let column = before.len();
    let target = header.target(column, own);
    let start = header.start(column, own);
    let mut specials = specials::of(cells);
    let shared = may_share
        .then(|| shared::indices(header, column, cells, own, effort))
        .flatten();
    if let Some((indices, values)) = shared {
        return CodedColumn {
            descriptor: CodecId::Shared as u8,
            head: Vec::new(),
            bytes: Vec::new(),
            indices: Some(indices),
            restored: specials::merged(&specials, &values),
            specials,
        };
    }
    let has_value = specials::has_value(&specials, cells.len());
    let samples = aligned(cells, &has_value);
    let mut others = related::columns(cells, before, effort);
    let values: Vec<Vec<f64>> = others.iter().map(|i| aligned(&before[*i], &has_value)).collect();
    let values: Vec<&[f64]> = values.iter().map(Vec::as_slice).collect();
    let context = Context {
        target: &target,
        start: start.as_ref(),
        others: &values,
    };
    let coded = codec::encode(&samples, context, effort);
    if !coded.uses_others {
        others.clear();
    }
    // Samples whose restored value is outside the bound are stored in full.
    if coded.broken > 0 {
        specials.resize(cells.len(), None);
        let mut values = samples.iter().zip(&coded.restored);
        for special in specials.iter_mut().filter(|special| special.is_none()) {
            if let Some((sample, value)) = values.next()
                && !target.holds(*sample, *value)
            {
                *special = Some(Special::Whole(sample.to_bits()));
            }
        }
    }
    let descriptor = coded.id as u8 | flag(own.is_some(), BOUND_FOLLOWS) | flag(!others.is_empty(), OTHERS_FOLLOW);
    let head = written(|fields| front(fields, column, descriptor, own, &others));
    CodedColumn {
        descriptor,
        head,
        bytes: coded.bytes,
        indices: None,
        restored: specials::merged(&specials, &coded.restored),
        specials,
    }
}

/// The rows of a block, and what their code depends on.
pub(crate) struct Rows<'a> {
    pub(crate) header: &'a Header,
    /// That of the block in its recording.
    pub(crate) number: u64,
    pub(crate) ticks: &'a [i64],
    pub(crate) columns: Vec<&'a [Option<f64>]>,
    /// The bounds that the block must state itself.
    pub(crate) own_bounds: Vec<Option<f64>>,
    pub(crate) effort: Effort,
}

impl Rows<'_> {
    /// The block's bytes, and the cells as a reader will restore them.
    pub(crate) fn block(&self) -> (Vec<u8>, Vec<Cells>) {
        let (content, restored) = self.content();
        (checked(self.header.check, &[], &content), restored)
    }

    /// As [`block`](Self::block), without length and checksum.
    pub(crate) fn content(&self) -> (Vec<u8>, Vec<Cells>) {
        let (content, restored, shares) = self.encoded(self.columns.len() <= SHARED_COLUMNS);
        // Columns with bytes of their own were verified one by one.
        let is_read = || {
            let read = decode_content(self.header, &content, |_| true);
            let read = read.map(|block| block.columns).unwrap_or_default();
            let bits = |columns: &[Cells]| -> Vec<_> {
                let cells = columns.iter().flatten();
                cells.map(|cell| cell.map(f64::to_bits)).collect()
            };
            bits(&read) == bits(&restored)
        };
        if !shares || is_read() {
            return (content, restored);
        }
        let (content, restored, _) = self.encoded(false);
        (content, restored)
    }

    /// The content without verifying the shared code. The third value says whether there is one.
    fn encoded(&self, may_share: bool) -> (Vec<u8>, Vec<Cells>, bool) {
        let (header, number, ticks, effort) = (self.header, self.number, self.ticks, self.effort);
        let (mut coded, mut restored) = (Vec::new(), Vec::with_capacity(self.columns.len()));
        for (cells, own) in self.columns.iter().zip(&self.own_bounds) {
            let mut column = encode_column(header, cells, *own, &restored, effort, may_share);
            restored.push(std::mem::take(&mut column.restored));
            coded.push(column);
        }
        let shares = coded.iter().any(|column| column.indices.is_some());
        let apart = !shares && header.has_starts();
        let (kind, time) = time::encode(ticks, &header.grid());
        let has_own: Vec<bool> = (0..)
            .zip(&coded)
            .map(|(i, column)| column.descriptor != plain(header, apart, i))
            .collect();
        let all_plain = !has_own.contains(&true);
        let whole = ticks.len() == header.block_rows();
        let specials: Vec<Specials> = coded
            .iter_mut()
            .map(|column| std::mem::take(&mut column.specials))
            .collect();
        let told = !shares && specials.iter().flatten().any(Option::is_some);
        let flags = kind as u64
            | flag(!whole, ROWS_FOLLOW)
            | flag(!all_plain, DESCRIPTORS_FOLLOW)
            | flag(told, SPECIALS_FOLLOW);
        // Nothing else follows the number of a block that stands there on the grid too.
        let is_usual = flags == TimeKind::Grid as u64 && Bytes(&time).varint() == Ok(number);
        let head = Head {
            number: Some(number),
            usual: is_usual.then_some(number),
            flags: flags | flag(apart, APART),
        };
        let mut body = written(|fields| head.code(fields, false));
        if !is_usual {
            if !whole {
                push_varint(&mut body, ticks.len() as u64);
            }
            body.extend_from_slice(&time);
        }
        if !all_plain {
            body.extend(has_own.chunks(8).map(|eight| {
                let bits = eight.iter().enumerate();
                bits.fold(0, |byte, (i, own)| byte | u8::from(*own) << i)
            }));
            let columns = coded.iter().zip(&has_own);
            body.extend(columns.filter(|(_, own)| **own).map(|(column, _)| column.descriptor));
        }
        if told {
            let bytes = specials::encode(&specials, ticks.len());
            push_varint(&mut body, bytes.len() as u64);
            body.extend(bytes);
        }
        let last = coded.len() - 1;
        let alone = coded.iter().enumerate().filter(|(_, column)| column.indices.is_none());
        for (i, column) in alone {
            body.extend_from_slice(&column.head);
            if shares || i < last {
                push_varint(&mut body, column.bytes.len() as u64);
            }
            body.extend_from_slice(&column.bytes);
        }
        if shares {
            let indices: Vec<Option<Vec<i64>>> = coded.into_iter().map(|column| column.indices).collect();
            body.extend(shared::encode(header, &self.columns, &specials, &indices, &restored, effort));
        }
        (body, restored, shares)
    }
}
