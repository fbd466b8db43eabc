//! glTF accessors: checked access to numbers in buffers.
//!
//! Covers quantised values (KHR_mesh_quantization), whose component type is sufficient, and sparse accessors.

use super::gltf::malformed;
use super::gltf_extensions::check_compression;
use super::parse::excerpt;
use crate::{Location, MeshError};
use gltf::json::accessor::sparse::Sparse;
use gltf::json::accessor::{ComponentType, Type};
use gltf::json::buffer::View;
use gltf::json::validation::Checked;
use gltf::json::{Accessor, Index, Root};
use std::borrow::Cow;

/// View of an accessor's values in its buffer.
pub(super) struct AccessorView<'a> {
    /// Values of the buffer view; `None` for zeros, which a sparse accessor may replace.
    base: Option<Values<'a>>,
    /// Sorted rows that a sparse accessor replaces, with their values.
    sparse: Option<(Vec<u32>, Values<'a>)>,
    pub(super) count: usize,
    is_normalized: bool,
}

/// Values of one component type at a regular distance.
struct Values<'a> {
    data: &'a [u8],
    stride: usize,
    component: ComponentType,
}

/// Buffers of a file, in the order of the JSON; `None` for a missing file.
pub(super) type Buffers<'a> = [Option<Cow<'a, [u8]>>];

impl<'a> AccessorView<'a> {
    /// View of an accessor of type `kind`, after checks that all values are within the buffer.
    pub(super) fn new(
        root: &Root,
        buffers: &'a Buffers<'a>,
        index: Index<Accessor>,
        kind: Type,
    ) -> Result<Self, MeshError> {
        let location = Location::Entry("accessor", index.value());
        let accessor = root.get(index);
        let accessor = accessor.ok_or_else(|| {
            malformed(location, "an existing accessor", root.accessors.len().to_string())
        })?;
        let (Checked::Valid(component), Checked::Valid(found)) =
            (&accessor.component_type, &accessor.type_)
        else {
            return Err(malformed(
                location,
                "a component type and a type",
                "unknown values".to_owned(),
            ));
        };
        let component = component.0;
        let is_index =
            matches!(component, ComponentType::U8 | ComponentType::U16 | ComponentType::U32);
        if *found != kind || (kind == Type::Scalar && !is_index) {
            let expected = match kind {
                Type::Vec3 => "VEC3",
                Type::Vec4 => "VEC4",
                Type::Mat4 => "MAT4",
                _ => "SCALAR of unsigned integers",
            };
            return Err(malformed(location, expected, format!("{found:?} of {component:?}")));
        }
        let count = accessor.count.0;
        if count == 0 {
            return Err(malformed(location, "at least one value", "none".to_owned()));
        }
        let offset = accessor.byte_offset.unwrap_or_default().0;
        let size = component.size() * kind.multiplicity();
        let source = Source { root, buffers, location, component, size };
        let base = match accessor.buffer_view {
            Some(view) => Some(source.values(view, offset, count)?),
            None if accessor.sparse.is_some() => None,
            None => {
                check_compression(root)?;
                return Err(malformed(location, "a buffer view", "none".to_owned()));
            }
        };
        let sparse = accessor.sparse.as_ref().map(|sparse| source.sparse(sparse)).transpose()?;
        let count = count as usize;
        Ok(Self { base, sparse, count, is_normalized: accessor.normalized })
    }

    /// Component `axis` of value `row`; requires `row < count`.
    pub(super) fn value(&self, row: usize, axis: usize) -> f64 {
        let replaced = self.sparse.as_ref().and_then(|(rows, values)| {
            let index = rows.binary_search(&(row as u32)).ok()?;
            Some((values, index))
        });
        let found = replaced.or(self.base.as_ref().map(|values| (values, row)));
        found.map_or(0.0, |(values, row)| values.value(row, axis, self.is_normalized))
    }
}

/// Buffers and type of an accessor.
struct Source<'r, 'a> {
    root: &'r Root,
    buffers: &'a Buffers<'a>,
    location: Location,
    component: ComponentType,
    /// Size of a value (bytes).
    size: usize,
}

impl<'a> Source<'_, 'a> {
    /// `count` (> 0) values from `offset` (bytes) of a buffer view on.
    fn values(&self, view: Index<View>, offset: u64, count: u64) -> Result<Values<'a>, MeshError> {
        let Some(view) = self.root.get(view) else {
            return Err(malformed(self.location, "a buffer view", "none".to_owned()));
        };
        let buffer: &[u8] = match self.buffers.get(view.buffer.value()) {
            Some(Some(buffer)) => buffer,
            Some(None) => {
                let uri = self.root.get(view.buffer).and_then(|buffer| buffer.uri.as_deref());
                let uri = excerpt(uri.unwrap_or_default().as_bytes());
                return Err(MeshError::ExternalBuffer { uri });
            }
            None => &[],
        };
        let size = self.size as u64;
        let stride = view.byte_stride.map_or(0, |stride| stride.0) as u64;
        let stride = if stride == 0 { size } else { stride };
        let start = offset.checked_add(view.byte_offset.unwrap_or_default().0);
        let length = (count - 1).checked_mul(stride).and_then(|x| x.checked_add(size));
        let end = start.zip(length).and_then(|(start, length)| start.checked_add(length));
        let data = start.zip(end).and_then(|(start, end)| {
            buffer.get(usize::try_from(start).ok()?..usize::try_from(end).ok()?)
        });
        match data {
            Some(data) if stride >= size => {
                Ok(Values { data, stride: stride as usize, component: self.component })
            }
            _ => {
                check_compression(self.root)?;
                let found = format!("{count} values every {stride} bytes of {}", buffer.len());
                Err(malformed(self.location, "values within the buffer", found))
            }
        }
    }

    /// Replaced rows and their values.
    fn sparse(&self, sparse: &Sparse) -> Result<(Vec<u32>, Values<'a>), MeshError> {
        let invalid = |found: &str| {
            malformed(self.location, "increasing indices of a sparse accessor", found.to_owned())
        };
        let Checked::Valid(component) = &sparse.indices.component_type else {
            return Err(invalid("an unknown component type"));
        };
        let component = match component.0 {
            ComponentType::U8 | ComponentType::U16 | ComponentType::U32 => component.0,
            _ => return Err(invalid("another component type")),
        };
        let count = sparse.count.0;
        if count == 0 {
            return Err(invalid("none"));
        }
        let source = Self { component, size: component.size(), ..*self };
        let indices = &sparse.indices;
        let rows = source.values(indices.buffer_view, indices.byte_offset.0, count)?;
        let rows: Vec<u32> =
            (0..count as usize).map(|row| rows.value(row, 0, false) as u32).collect();
        if !rows.is_sorted_by(|a, b| a < b) {
            return Err(invalid("others"));
        }
        let values = &sparse.values;
        Ok((rows, self.values(values.buffer_view, values.byte_offset.0, count)?))
    }
}

impl Values<'_> {
    fn value(&self, row: usize, axis: usize, is_normalized: bool) -> f64 {
        let offset = row * self.stride + axis * self.component.size();
        let mut raw = [0; 4];
        for (to, from) in raw.iter_mut().zip(self.data[offset..].iter().take(self.component.size()))
        {
            *to = *from;
        }
        let bits = u32::from_le_bytes(raw);
        let (value, max) = match self.component {
            ComponentType::I8 => (f64::from(bits as i8), f64::from(i8::MAX)),
            ComponentType::U8 => (f64::from(bits), f64::from(u8::MAX)),
            ComponentType::I16 => (f64::from(bits as i16), f64::from(i16::MAX)),
            ComponentType::U16 => (f64::from(bits), f64::from(u16::MAX)),
            ComponentType::U32 => (f64::from(bits), f64::from(u32::MAX)),
            ComponentType::F32 => return f64::from(f32::from_bits(bits)),
        };
        if is_normalized { (value / max).max(-1.0) } else { value }
    }
}
