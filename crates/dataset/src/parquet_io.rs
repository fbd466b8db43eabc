//! Parquet files with a few column types. Equal values give equal bytes.

use anyhow::{Context, Result};
use arrow_array::cast::AsArray;
use arrow_array::types::Float32Type;
use arrow_array::{
    Array, ArrayRef, BooleanArray, FixedSizeListArray, Float32Array, Int64Array, ListArray,
    RecordBatch, StringArray,
};
use arrow_schema::{DataType, Field, Schema};
use files::atomic_file;
use parquet::arrow::ArrowWriter;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use parquet::basic::{Compression, Encoding};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::schema::types::ColumnPath;
use std::collections::HashMap;
use std::fs::File;
use std::path::Path;
use std::sync::Arc;

/// Values of a column.
pub enum Column {
    /// Single-precision numbers.
    Floats(Vec<f32>),
    /// Vectors of a fixed length.
    Vectors(Vec<f32>, usize),
    /// Point clouds with a fixed number of points, x, y, z each.
    Clouds(Vec<f32>, usize),
    /// 64-bit integers.
    Integers(Vec<i64>),
    /// Flags, `None` where unknown.
    Flags(Vec<Option<bool>>),
    /// UTF-8 strings.
    Texts(Vec<String>),
    /// Lists with one string each.
    TextList(Vec<String>),
}

/// Names and values of columns.
pub type Columns = Vec<(&'static str, Column)>;

impl Column {
    fn array(self) -> Result<ArrayRef> {
        Ok(match self {
            Self::Floats(values) => Arc::new(Float32Array::from(values)),
            Self::Integers(values) => Arc::new(Int64Array::from(values)),
            Self::Flags(values) => Arc::new(BooleanArray::from(values)),
            Self::Texts(values) => Arc::new(StringArray::from(values)),
            Self::Vectors(values, width) => Arc::new(vectors(values, width)?),
            Self::Clouds(values, points) => {
                let points_array = vectors(values, 3)?;
                let item = Arc::new(Field::new("item", points_array.data_type().clone(), false));
                let clouds = Arc::new(points_array);
                Arc::new(FixedSizeListArray::try_new(item, points as i32, clouds, None)?)
            }
            Self::TextList(values) => {
                let mut lists = arrow_array::builder::ListBuilder::new(
                    arrow_array::builder::StringBuilder::new(),
                );
                for value in values {
                    lists.values().append_value(value);
                    lists.append(true);
                }
                let lists: ListArray = lists.finish();
                Arc::new(lists)
            }
        })
    }
}

fn vectors(values: Vec<f32>, width: usize) -> Result<FixedSizeListArray> {
    let item = Arc::new(Field::new("item", DataType::Float32, false));
    let values = Arc::new(Float32Array::from(values));
    Ok(FixedSizeListArray::try_new(item, width as i32, values, None)?)
}

fn batch(columns: Columns) -> Result<RecordBatch> {
    let mut fields = Vec::new();
    let mut arrays = Vec::new();
    for (name, column) in columns {
        let is_nullable = matches!(column, Column::Flags(_));
        let array = column.array()?;
        fields.push(Field::new(name, array.data_type().clone(), is_nullable));
        arrays.push(array);
    }
    Ok(RecordBatch::try_new(Arc::new(Schema::new(fields)), arrays)?)
}

/// Snappy, as LeRobot writes: readers in browsers decompress it without an additional package. Float vectors
/// compress best with byte-stream split, because the leading bytes of adjacent values are similar.
fn properties(batch: &RecordBatch, metadata: Option<(&str, String)>) -> Result<WriterProperties> {
    let mut properties = WriterProperties::builder()
        .set_compression(Compression::SNAPPY)
        .set_max_row_group_row_count(None)
        .set_statistics_enabled(EnabledStatistics::Chunk);
    for field in batch.schema().fields() {
        if matches!(field.data_type(), DataType::FixedSizeList(..)) {
            let path = vec![field.name().clone(), "list".to_owned(), "item".to_owned()];
            let path = ColumnPath::new(path);
            properties = properties
                .set_column_dictionary_enabled(path.clone(), false)
                .set_column_encoding(path, Encoding::BYTE_STREAM_SPLIT);
        }
    }
    if let Some((key, value)) = metadata {
        let pair = KeyValue::new(key.to_owned(), value);
        properties = properties.set_key_value_metadata(Some(vec![pair]));
    }
    Ok(properties.build())
}

/// Writes a table with one row group for each item of `groups`.
pub fn write(
    path: &Path,
    groups: impl IntoIterator<Item = Result<Columns>>,
    metadata: Option<(&str, String)>,
) -> Result<()> {
    atomic_file::write_with(path, |file| {
        let mut writer: Option<ArrowWriter<File>> = None;
        for group in groups {
            let batch = batch(group?)?;
            if writer.is_none() {
                let properties = properties(&batch, metadata.clone())?;
                // pyarrow ignores the file's own key-value pairs if the file has an Arrow schema, so the pair
                // is part of that schema, too.
                let pair = metadata.clone().map(|(key, value)| (key.to_owned(), value));
                let pairs: HashMap<String, String> = pair.into_iter().collect();
                let schema = batch.schema().as_ref().clone().with_metadata(pairs);
                let file = File::create(file)?;
                writer = Some(ArrowWriter::try_new(file, Arc::new(schema), Some(properties))?);
            }
            if let Some(writer) = &mut writer {
                writer.write(&batch)?;
                writer.flush()?;
            }
        }
        writer.context("the table has no row groups")?.close()?;
        Ok(())
    })
}

/// Reads one row group of a table.
pub fn read_group(path: &Path, group: usize) -> Result<RecordBatch> {
    let file = File::open(path).with_context(|| format!("cannot read {}", path.display()))?;
    let damaged = || format!("{} is damaged", path.display());
    let builder = ParquetRecordBatchReaderBuilder::try_new(file).with_context(damaged)?;
    anyhow::ensure!(group < builder.metadata().num_row_groups(), "{} is too short", path.display());
    let rows = builder.metadata().row_group(group).num_rows() as usize;
    let mut reader = builder.with_row_groups(vec![group]).with_batch_size(rows.max(1)).build()?;
    let batch = reader.next().with_context(damaged)?;
    batch.with_context(damaged)
}

/// Number of row groups of a table.
pub fn num_row_groups(path: &Path) -> Result<usize> {
    let file = File::open(path).with_context(|| format!("cannot read {}", path.display()))?;
    let builder = ParquetRecordBatchReaderBuilder::try_new(file)
        .with_context(|| format!("{} is damaged", path.display()))?;
    Ok(builder.metadata().num_row_groups())
}

fn column<'a>(batch: &'a RecordBatch, name: &str) -> Result<&'a ArrayRef> {
    batch.column_by_name(name).with_context(|| format!("the table has no column {name}"))
}

/// Values of a float column, or of a column of float vectors.
pub fn floats<'a>(batch: &'a RecordBatch, name: &str) -> Result<&'a [f32]> {
    let array = column(batch, name)?;
    let values = match array.as_fixed_size_list_opt() {
        Some(vectors) => vectors.values(),
        None => array,
    };
    let values = values.as_primitive_opt::<Float32Type>();
    Ok(values.with_context(|| format!("column {name} does not contain floats"))?.values())
}

/// Values of an integer column.
pub fn integers<'a>(batch: &'a RecordBatch, name: &str) -> Result<&'a [i64]> {
    let values = column(batch, name)?.as_primitive_opt::<arrow_array::types::Int64Type>();
    Ok(values.with_context(|| format!("column {name} does not contain integers"))?.values())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn table_round_trips_with_identical_bytes() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let group = |first: i64| {
            Ok(vec![
                ("v", Column::Vectors(vec![0.5, first as f32, 2.0, 3.0], 2)),
                ("i", Column::Integers(vec![first, 7])),
                ("t", Column::Texts(vec!["a".into(), "b".into()])),
                ("f", Column::Flags(vec![None, Some(true)])),
                ("l", Column::TextList(vec!["c".into(), "d".into()])),
            ])
        };
        for name in ["one", "two"] {
            write(&path(name), [group(1), group(5)], Some(("key", "value".into()))).unwrap();
        }
        assert_eq!(std::fs::read(path("one")).unwrap(), std::fs::read(path("two")).unwrap());
        let batch = read_group(&path("one"), 1).unwrap();
        assert_eq!(num_row_groups(&path("one")).unwrap(), 2);
        assert_eq!(floats(&batch, "v").unwrap(), [0.5, 5.0, 2.0, 3.0]);
        assert_eq!(integers(&batch, "i").unwrap(), [5, 7]);
        assert!(floats(&batch, "i").unwrap_err().to_string().contains("does not contain floats"));
        assert!(read_group(&path("one"), 2).is_err());
        std::fs::write(path("bad"), b"PAR1 and more").unwrap();
        assert!(read_group(&path("bad"), 0).unwrap_err().to_string().contains("is damaged"));
    }
}
