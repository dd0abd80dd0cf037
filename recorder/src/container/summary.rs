//! The summary at the end of a complete file, and the attachments that it lists.

use super::{Bytes, Channels, Damage, Declared, FOOTER_BYTES, magic};
use crate::source::Source;
use mcap::MAGIC;
use mcap::records::{AttachmentIndex, ChunkIndex, Record};
use std::collections::{BTreeMap, BTreeSet};

/// Index at the end of a complete file.
pub struct Summary {
    pub channels: Channels,
    /// Places of the attachments.
    pub attachments: Vec<AttachmentIndex>,
    /// Places of the chunks; `None` if the file does not list all of them.
    pub chunks: Option<Vec<ChunkIndex>>,
}

/// The summary of a file; `None` if it has none.
pub fn summary(source: Source<'_>) -> Result<Option<Summary>, Damage> {
    let file = Bytes { source, of: "" };
    magic(&file, 0)?;
    let end = source.len().saturating_sub(MAGIC.len());
    magic(&file, end)?;
    let footer_at = end.saturating_sub(FOOTER_BYTES);
    let raw = file.record(footer_at)?;
    let Record::Footer(footer) = file.parsed(footer_at, &raw)? else {
        return Err(file.damage(footer_at, "expected the footer"));
    };
    if footer.summary_start == 0 {
        return Ok(None);
    }
    let (mut channels, mut known, mut counts) = (Declared::of(&source), Vec::new(), BTreeMap::new());
    let (mut attachments, mut offsets, mut attached) = (Vec::new(), BTreeSet::new(), 0_u64);
    let (mut chunks, mut chunk_count) = (Vec::new(), None);
    let section = Bytes { source: source.up_to(footer_at), of: "" };
    let mut at = usize::try_from(footer.summary_start).unwrap_or(usize::MAX);
    while at != footer_at {
        let raw = section.record(at)?;
        match section.parsed(at, &raw)? {
            Record::Statistics(statistics) => {
                chunk_count = Some(statistics.chunk_count as usize);
                counts = statistics.channel_message_counts;
            }
            Record::ChunkIndex(index) => chunks.push(index),
            Record::AttachmentIndex(index) => {
                // Each is read whole: one that is listed again and again would take any amount of memory.
                if !offsets.insert(index.offset) {
                    return Err(section.damage(at, "expected an attachment that is not listed yet"));
                }
                // One within another would be read twice.
                attached = attached.saturating_add(index.length);
                if attached > source.len() as u64 {
                    return Err(section.damage(at, "the attachments are longer than the file"));
                }
                attachments.push(index);
            }
            Record::Channel(channel) => {
                known.push(channel.id);
                let added = channels.add_channel(channel, raw.body.len());
                added.map_err(|fault| section.fault(at, "", &fault))?;
            }
            Record::Schema { header, data } => {
                let added = channels.add_schema(header, data.into_owned());
                added.map_err(|fault| section.fault(at, "", &fault))?;
            }
            _ => {}
        }
        at = raw.end;
    }
    let counted = |id: u16| Some((id, (channels.all.get(id)?, counts.get(&id).copied().unwrap_or(0))));
    let channels = known.into_iter().filter_map(counted).collect();
    let chunks = Some(chunks).filter(|chunks| chunk_count == Some(chunks.len()) && !chunks.is_empty());
    Ok(Some(Summary { channels, attachments, chunks }))
}

/// Name and content of the attachment at the place that `index` names.
pub fn attachment(source: Source<'_>, index: &AttachmentIndex) -> Result<(String, Vec<u8>), Damage> {
    let file = Bytes { source, of: "" };
    let at = usize::try_from(index.offset).unwrap_or(usize::MAX);
    let raw = file.record(at)?;
    match file.parsed(at, &raw)? {
        Record::Attachment { header, data, .. } if index.length == (raw.end - at) as u64 => {
            Ok((header.name, data.into_owned()))
        }
        _ => Err(file.damage(at, "expected the attachment that the summary names there")),
    }
}
