//! Tables as Apache Parquet, written byte-reproducibly and read back.
//!
//! Numbers are required doubles (a blank is not-a-number), whole numbers 64-bit integers, words dictionary-encoded UTF-8. What a CSV file says in
//! its first line stands in the file's metadata under the key `twofold`. Nothing is compressed: section points are noise to a compressor, and
//! the compressors that other programs expect are not pure Rust.
//!
//! A Parquet file is little-endian. The crate writes and reads numbers, and writes the lengths of words, in the machine's own order of bytes: on a big-endian machine that is put right here
//! (found by running `check` on s390x).

mod thrift;

use std::borrow::Cow;
use std::sync::Arc;

use bytes::Bytes;
use parquet::basic::{Encoding, LogicalType, Repetition, Type as Physical};
use parquet::column::page::{Page, PageReader};
use parquet::column::reader::ColumnReader;
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::{KeyValue, ParquetMetaData};
use parquet::file::properties::{EnabledStatistics, WriterProperties, WriterVersion};
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::{ColumnPath, Type};
use serde_json::Value;

use super::encode::{Heading, Malformed, heading};
use super::table::{Cells, Column, Kind, Table};
use crate::record::hash::canonical_json;

/// The key of our metadata.
const KEY: &str = "twofold";
/// Rows of a row group: fixed, because it is part of the bytes.
const GROUP: usize = 1 << 20;
/// Most rows that are read of a table of words alone: a page of equal words has hardly any bytes, however many they are. Numbers pay for their rows.
const WORDS: usize = 20_000_000;

/// The table as a Parquet file; `about` is whatever its maker wants to say.
pub fn parquet(table: &Table, about: &Value) -> Vec<u8> {
    let mut bytes = Vec::new();
    write(table, about, &mut bytes)
        .expect("memory takes what is written to it, and the schema fits the table by construction");
    bytes
}

fn write(table: &Table, about: &Value, bytes: &mut Vec<u8>) -> Result<(), ParquetError> {
    let fields = table
        .columns
        .iter()
        .map(|c| {
            let field = match c.kind() {
                Kind::Number => Type::primitive_type_builder(&c.name, Physical::DOUBLE),
                Kind::Integer => Type::primitive_type_builder(&c.name, Physical::INT64),
                Kind::Word => Type::primitive_type_builder(&c.name, Physical::BYTE_ARRAY)
                    .with_logical_type(Some(LogicalType::String)),
            };
            field.with_repetition(Repetition::REQUIRED).build().map(Arc::new)
        })
        .collect::<Result<Vec<_>, _>>()?;
    let schema = Arc::new(Type::group_type_builder(&table.name).with_fields(fields).build()?);
    let metadata = String::from_utf8_lossy(&canonical_json(&heading(table, about))).into_owned();
    let mut properties = WriterProperties::builder()
        .set_writer_version(WriterVersion::PARQUET_1_0)
        .set_created_by(concat!("twofold ", env!("CARGO_PKG_VERSION")).to_owned())
        .set_statistics_enabled(EnabledStatistics::None)
        .set_dictionary_enabled(false)
        .set_encoding(Encoding::PLAIN)
        .set_key_value_metadata(Some(vec![KeyValue::new(KEY.to_owned(), metadata)]));
    for column in table.columns.iter().filter(|c| c.kind() == Kind::Word) {
        // However many: `lengths_in_file_order` looks for every word there.
        let path = ColumnPath::from(column.name.as_str());
        properties = properties
            .set_column_dictionary_enabled(path.clone(), true)
            .set_column_dictionary_page_size_limit(path, usize::MAX);
    }
    let mut writer = SerializedFileWriter::new(&mut *bytes, schema, Arc::new(properties.build()))?;
    for start in (0..table.len()).step_by(GROUP) {
        let rows = start..(start + GROUP).min(table.len());
        let mut group = writer.next_row_group()?;
        for column in &table.columns {
            let mut to = group.next_column()?.ok_or_else(|| ParquetError::General("a column is missing".into()))?;
            match &column.cells {
                Cells::Numbers(v) => {
                    to.typed::<DoubleType>().write_batch(&in_file_order(&v[rows.clone()], little), None, None)?
                }
                Cells::Integers(v) => {
                    to.typed::<Int64Type>().write_batch(&in_file_order(&v[rows.clone()], i64::to_le), None, None)?
                }
                Cells::Words(w) => {
                    let words: Vec<ByteArray> = rows.clone().map(|row| ByteArray::from(w.get(row))).collect();
                    to.typed::<ByteArrayType>().write_batch(&words, None, None)?
                }
            };
            to.close()?;
        }
        group.close()?;
    }
    let metadata = writer.close()?;
    // Elsewhere they are right; tests look there too whether this finds them.
    if cfg!(any(target_endian = "big", debug_assertions)) {
        lengths_in_file_order(table, &metadata, bytes);
    }
    Ok(())
}

/// The number whose bytes in this machine's order are those of `value` in a file.
fn little(value: f64) -> f64 {
    f64::from_bits(value.to_bits().to_le())
}

/// What the crate is to write.
fn in_file_order<T: Copy>(values: &[T], little: impl Fn(T) -> T) -> Cow<'_, [T]> {
    if cfg!(target_endian = "big") {
        Cow::Owned(values.iter().map(|value| little(*value)).collect())
    } else {
        Cow::Borrowed(values)
    }
}

/// Writes the lengths of words in dictionaries anew. A dictionary has a group's words in the order in which they occur there, each behind its length in four bytes, and ends where the data begin.
fn lengths_in_file_order(table: &Table, metadata: &ParquetMetaData, bytes: &mut [u8]) {
    for (group, start) in metadata.row_groups().iter().zip((0..table.len()).step_by(GROUP)) {
        for (column, chunk) in table.columns.iter().zip(group.columns()) {
            let Cells::Words(words) = &column.cells else { continue };
            let mut seen = vec![false; words.vocabulary.len()];
            let codes = &words.codes[start..(start + GROUP).min(table.len())];
            let first = |code: &&u32| !std::mem::replace(&mut seen[**code as usize], true);
            let dictionary: Vec<&String> =
                codes.iter().filter(first).map(|code| &words.vocabulary[*code as usize]).collect();
            let long: usize = dictionary.iter().map(|word| 4 + word.len()).sum();
            let mut at = chunk.data_page_offset() as usize - long;
            for word in dictionary {
                let length = word.len() as u32;
                debug_assert_eq!(bytes[at..at + 4], length.to_ne_bytes());
                bytes[at..at + 4].copy_from_slice(&length.to_le_bytes());
                at += 4 + word.len();
            }
        }
    }
}

/// Whether the footer is one as it is written here: it stands before its length, in four bytes, and the magic number. What is too short for that is left to the crate's words.
fn footer_is_sound(bytes: &[u8]) -> bool {
    let Some((before, [length @ .., _, _, _, _])) = bytes.split_last_chunk::<8>() else { return true };
    let length = u32::from_le_bytes(*length) as usize;
    let Some(start) = before.len().checked_sub(length) else { return true };
    thrift::structure(&before[start..], thrift::FOOTER, 0).is_some()
}

/// Whether the headers of a column's pages, the first of them at `start`, the last one's page up to `end`, are such as they are written here.
fn headers_are_sound(bytes: &[u8], start: u64, end: u64) -> bool {
    let (Ok(mut at), Ok(end)) = (usize::try_from(start), usize::try_from(end)) else { return false };
    while at < end {
        let header = |bytes| thrift::structure(bytes, thrift::PAGE, thrift::PAGE_LENGTH);
        let Some((header, length)) = bytes.get(at..).and_then(header) else { return false };
        let Ok(length) = usize::try_from(length) else { return false };
        at = at.saturating_add(header).saturating_add(length);
    }
    true
}

/// Whether a column's pages are such as [`parquet()`] writes. The decoders, unlike what reads the pages, take a page's word for how many values it has, and for a dictionary
/// that came before it: a file that lies would end the process.
fn sound(pages: Box<dyn PageReader>, kind: Kind, rows: usize) -> Result<bool, ParquetError> {
    let (mut values, mut dictionary) = (0, false);
    for page in pages {
        // A number has eight bytes, a word has four that say its length.
        let held =
            match page? {
                Page::DictionaryPage { buf, num_values, encoding, .. }
                    if kind == Kind::Word && !dictionary && values == 0 && num_values as usize <= buf.len() / 4 =>
                {
                    dictionary = matches!(encoding, Encoding::PLAIN | Encoding::PLAIN_DICTIONARY);
                    0
                }
                Page::DataPage { buf, num_values, encoding: Encoding::PLAIN, .. }
                    if (kind == Kind::Word && num_values as usize <= buf.len() / 4)
                        || (kind != Kind::Word && u64::from(num_values) * 8 == buf.len() as u64) =>
                {
                    num_values
                }
                Page::DataPage {
                    num_values, encoding: Encoding::RLE_DICTIONARY | Encoding::PLAIN_DICTIONARY, ..
                } if dictionary => num_values,
                _ => return Ok(false),
            };
        values += u64::from(held);
    }
    Ok(values == rows as u64)
}

/// The table of which [`parquet()`] made this file, and what it says about itself.
///
/// # Errors
///
/// If the file is anything else.
pub fn from_parquet(bytes: &[u8]) -> Result<(Heading, Table), Malformed> {
    read(bytes, WORDS)
}

/// [`from_parquet`] with at most so many rows of words alone.
fn read(bytes: &[u8], most_words: usize) -> Result<(Heading, Table), Malformed> {
    let wrong = |e: ParquetError| Malformed(e.to_string());
    if !footer_is_sound(bytes) {
        return Err(Malformed("its footer is not laid out as it is here".into()));
    }
    let reader = SerializedFileReader::new(Bytes::copy_from_slice(bytes)).map_err(wrong)?;
    let metadata = reader.metadata().file_metadata();
    let ours = metadata.key_value_metadata().and_then(|all| all.iter().find(|kv| kv.key == KEY));
    let Some(text) = ours.and_then(|kv| kv.value.as_deref()) else {
        return Err(Malformed("it has no metadata of ours".into()));
    };
    let heading: Heading = serde_json::from_str(text).map_err(|e| Malformed(format!("its metadata: {e}")))?;
    let mut table = Table::new(&heading.table, heading.columns.iter().map(|c| Column::new(&c.name, &c.unit, c.kind)));
    if metadata.schema_descr().num_columns() != table.columns.len() {
        return Err(Malformed("its columns are not those of its metadata".into()));
    }
    // Columns may say that they stand at the same place, and all be read from there.
    let mut held = 0_u64;
    for chunk in reader.metadata().row_groups().iter().flat_map(|group| group.columns()) {
        let places = [Some(chunk.compressed_size()), Some(chunk.data_page_offset()), chunk.dictionary_page_offset()];
        if places.iter().flatten().any(|place| *place < 0) {
            return Err(Malformed("a column at a negative place".into()));
        }
        held = held.saturating_add(chunk.compressed_size() as u64);
        let (start, length) = chunk.byte_range();
        if !headers_are_sound(bytes, start, start.saturating_add(length)) {
            return Err(Malformed(format!("column {} is not laid out as it is here", chunk.column_path())));
        }
    }
    if held > bytes.len() as u64 {
        return Err(Malformed("its columns are longer than the file".into()));
    }
    let words_alone = heading.columns.iter().all(|c| c.kind == Kind::Word);
    for group in 0..reader.num_row_groups() {
        let group = reader.get_row_group(group).map_err(wrong)?;
        let rows = usize::try_from(group.metadata().num_rows()).map_err(|_| Malformed("a negative length".into()))?;
        if rows > GROUP || (words_alone && table.len() + rows > most_words) {
            return Err(Malformed(format!("a group of {rows} rows")));
        }
        for (i, column) in table.columns.iter().enumerate() {
            let description = metadata.schema_descr().column(i);
            let required = description.max_def_level() == 0 && description.max_rep_level() == 0;
            let pages = group.get_column_page_reader(i).map_err(wrong)?;
            if !required || !sound(pages, column.kind(), rows).map_err(wrong)? {
                return Err(Malformed(format!("column {} is not laid out as it is here", column.name)));
            }
        }
        for (i, column) in table.columns.iter_mut().enumerate() {
            let read = match (&mut column.cells, group.get_column_reader(i).map_err(wrong)?) {
                (Cells::Numbers(v), ColumnReader::DoubleColumnReader(mut r)) => {
                    let before = v.len();
                    let read = r.read_records(rows, None, None, v);
                    v[before..].iter_mut().for_each(|value| *value = little(*value));
                    read
                }
                (Cells::Integers(v), ColumnReader::Int64ColumnReader(mut r)) => {
                    let before = v.len();
                    let read = r.read_records(rows, None, None, v);
                    v[before..].iter_mut().for_each(|value| *value = value.to_le());
                    read
                }
                (Cells::Words(w), ColumnReader::ByteArrayColumnReader(mut r)) => {
                    let mut words = Vec::new();
                    let read = r.read_records(rows, None, None, &mut words).map_err(wrong)?;
                    for word in &words {
                        w.push(word.as_utf8().map_err(wrong)?);
                    }
                    Ok(read)
                }
                _ => {
                    return Err(Malformed(format!("column {} is of another kind than its metadata says", column.name)));
                }
            };
            if read.map_err(wrong)?.0 != rows {
                return Err(Malformed(format!("column {} is too short", column.name)));
            }
        }
    }
    Ok((heading, table))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::encode::bits;
    use ::parquet::file::metadata::{ParquetMetaDataWriter, RowGroupMetaData};
    use serde_json::json;

    fn table(rows: usize) -> Table {
        let mut table =
            Table::new("t", [Column::new("x", "m", Kind::Number), Column::words("mode"), Column::integers("n")]);
        for i in 0..rows {
            let x = if i % 5 == 0 { f64::NAN } else { 1.0 / (i as f64) };
            table.push([x.into(), ["up", "", "é,\n"][i % 3].into(), (-(i as i64)).into()]);
        }
        table
    }

    #[test]
    fn comes_back_and_is_reproducible() {
        for rows in [0, 1, 1000] {
            let t = table(rows);
            let about = json!({ "question": [1, 2] });
            let bytes = parquet(&t, &about);
            assert_eq!(bytes, parquet(&t, &about));
            let (heading, back) = from_parquet(&bytes).unwrap();
            assert_eq!(heading.about, about);
            assert_eq!(bits(&[back]), bits(&[t]), "{rows} rows");
        }
    }

    /// A file is little-endian, whatever the machine: the bytes of a short one.
    #[test]
    fn bytes_are_in_file_order() {
        let mut table =
            Table::new("t", [Column::new("x", "", Kind::Number), Column::words("w"), Column::integers("n")]);
        table.push([(-2.5).into(), "up".into(), 258.into()]);
        let bytes = parquet(&table, &Value::Null);
        let has = |what: &[u8]| bytes.windows(what.len()).any(|window| window == what);
        assert!(has(&[0, 0, 0, 0, 0, 0, 4, 0xc0]), "-2.5");
        assert!(has(&[2, 1, 0, 0, 0, 0, 0, 0]), "258");
        assert!(has(&[2, 0, 0, 0, b'u', b'p']), "two letters");
    }

    /// Words of more than a megabyte, the last ones in a second group of rows.
    #[test]
    fn many_words_are_a_dictionary_too() {
        let mut t = Table::new("t", [Column::words("w")]);
        let word = |i: usize| format!("word number {i} of very many");
        for i in 0..50_000 {
            t.push([word(i).as_str().into()]);
        }
        for i in 0..GROUP {
            t.push([word(i % 10).as_str().into()]);
        }
        let (_, back) = from_parquet(&parquet(&t, &Value::Null)).unwrap();
        assert!(bits(&[back]) == bits(&[t]));
    }

    /// A dictionary that is passed over, and one that claims more words than it has bytes for.
    #[test]
    fn pages_that_lie_are_refused() {
        let bytes = parquet(&table(100), &Value::Null);
        let reader = SerializedFileReader::new(Bytes::from(bytes.clone())).unwrap();
        let at = reader.metadata().row_group(0).column(1).dictionary_page_offset().unwrap() as usize;
        // The page's header (Thrift's compact protocol): field 1, its type, is 2: a dictionary; fields 2 and 3 are its lengths; field 7 begins with the number of words.
        assert_eq!(bytes[at..at + 2], [0x15, 2 << 1]);
        assert_eq!(
            (bytes[at + 2], bytes[at + 4], bytes[at + 6..at + 9].to_vec()),
            (0x15, 0x15, vec![0x4c, 0x15, 3 << 1])
        );
        for (place, value) in [(1, 1 << 1), (8, 60 << 1)] {
            let mut lies = bytes.clone();
            lies[at + place] = value;
            let said = from_parquet(&lies).unwrap_err().to_string();
            assert!(said.contains("column mode is not laid out as it is here"), "{said}");
        }
    }

    /// What a page's header and the footer say is looked at before the crate reads them.
    #[test]
    fn claims_are_no_work() {
        let bytes = parquet(&table(100), &Value::Null);
        let reader = SerializedFileReader::new(Bytes::from(bytes.clone())).unwrap();
        let at = reader.metadata().row_group(0).column(0).data_page_offset() as usize;
        // The header's first field, its type, made a list of so many truth values.
        let mut claims = bytes.clone();
        claims[at..at + 7].copy_from_slice(&[0x19, 0xf1, 0xff, 0xff, 0xff, 0xff, 0x07]);
        let said = from_parquet(&claims).unwrap_err().to_string();
        assert!(said.contains("is not laid out as it is here"), "{said}");
        // The footer's, its version.
        let footer = bytes.len() - 8 - u32::from_le_bytes(bytes[bytes.len() - 8..][..4].try_into().unwrap()) as usize;
        let mut claims = bytes.clone();
        claims[footer..footer + 7].copy_from_slice(&[0x19, 0xf1, 0xff, 0xff, 0xff, 0xff, 0x07]);
        let said = from_parquet(&claims).unwrap_err().to_string();
        assert!(said.contains("its footer is not laid out as it is here"), "{said}");
    }

    /// `bytes` with other row groups in its footer.
    fn with_groups(bytes: &[u8], change: impl Fn(&RowGroupMetaData) -> Vec<RowGroupMetaData>) -> Vec<u8> {
        let reader = SerializedFileReader::new(Bytes::copy_from_slice(bytes)).unwrap();
        let metadata = reader.metadata().clone();
        let groups = metadata.row_groups().iter().flat_map(change).collect();
        let metadata = metadata.into_builder().set_row_groups(groups).build();
        // A footer ends with its length and the magic number.
        let (before, end) = bytes.split_at(bytes.len() - 8);
        let footer = u32::from_le_bytes(end[..4].try_into().unwrap()) as usize;
        let mut changed = before[..before.len() - footer].to_vec();
        ParquetMetaDataWriter::new(&mut changed, &metadata).finish().unwrap();
        changed
    }

    /// The same bytes for every group of rows: a short file that would be a long table.
    #[test]
    fn one_place_is_read_once() {
        let bytes = parquet(&table(1000), &Value::Null);
        let same = with_groups(&bytes, |group| vec![group.clone()]);
        assert_eq!(bits(&[from_parquet(&same).unwrap().1]), bits(&[table(1000)]), "a footer may be written anew");
        let said = from_parquet(&with_groups(&bytes, |group| vec![group.clone(); 3])).unwrap_err().to_string();
        assert!(said.contains("its columns are longer than the file"), "{said}");
        let negative = with_groups(&bytes, |group| {
            let mut columns = group.columns().to_vec();
            columns[0] = columns[0].clone().into_builder().set_data_page_offset(-4).build().unwrap();
            vec![group.clone().into_builder().set_column_metadata(columns).build().unwrap()]
        });
        let said = from_parquet(&negative).unwrap_err().to_string();
        assert!(said.contains("a column at a negative place"), "{said}");
    }

    /// Words alone take next to no room in a file, and much in memory.
    #[test]
    fn words_alone_are_so_many_at_most() {
        let words = |rows: usize| {
            let mut table = Table::new("t", [Column::words("mode")]);
            (0..rows).for_each(|_| table.push(["up".into()]));
            parquet(&table, &Value::Null)
        };
        let bytes = words(5000);
        assert!(bytes.len() < 2000, "{} bytes", bytes.len());
        assert_eq!(read(&bytes, 5000).unwrap().1.len(), 5000);
        let said = read(&bytes, 4999).unwrap_err().to_string();
        assert!(said.contains("a group of 5000 rows"), "{said}");
        // Numbers pay for their rows.
        assert_eq!(read(&parquet(&table(1000), &Value::Null), 10).unwrap().1.len(), 1000);
    }

    #[test]
    fn other_files_are_refused() {
        let bytes = parquet(&table(100), &Value::Null);
        assert!(from_parquet(b"PAR1").is_err() && from_parquet(b"").is_err());
        for cut in [4, bytes.len() / 2, bytes.len() - 1] {
            assert!(from_parquet(&bytes[..cut]).is_err(), "cut at {cut}");
        }
    }
}
