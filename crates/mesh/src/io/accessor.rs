//! glTF accessors: checked access to numbers in buffers.
//!
//! Covers quantised values (KHR_mesh_quantization): their component type is sufficient.

use super::gltf::{malformed, unsupported};
use super::parse::excerpt;
use crate::{Location, MeshError};
use gltf::json::accessor::{ComponentType, Type};
use gltf::json::validation::Checked;
use gltf::json::{Accessor, Index, Root};
use std::borrow::Cow;

/// View of an accessor's values in its buffer.
pub(super) struct AccessorView<'a> {
    data: &'a [u8],
    pub(super) count: usize,
    stride: usize,
    component: ComponentType,
    is_normalized: bool,
}

impl<'a> AccessorView<'a> {
    /// View of an accessor of type `kind`, after checks that all values are within the buffer.
    pub(super) fn new(
        root: &Root,
        buffers: &'a [Option<Cow<'a, [u8]>>],
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
            let expected = if kind == Type::Vec3 { "VEC3" } else { "SCALAR of unsigned integers" };
            return Err(malformed(location, expected, format!("{found:?} of {component:?}")));
        }
        if accessor.sparse.is_some() {
            return Err(unsupported("sparse accessors".to_owned()));
        }
        let view = accessor.buffer_view.and_then(|view| root.get(view));
        let view = view.ok_or_else(|| malformed(location, "a buffer view", "none".to_owned()))?;
        let buffer: &[u8] = match buffers.get(view.buffer.value()) {
            Some(Some(buffer)) => buffer,
            Some(None) => {
                let uri = root.get(view.buffer).and_then(|buffer| buffer.uri.as_deref());
                let uri = excerpt(uri.unwrap_or_default().as_bytes());
                return Err(MeshError::ExternalBuffer { uri });
            }
            None => &[],
        };
        let size = (component.size() * kind.multiplicity()) as u64;
        let stride = view.byte_stride.map_or(0, |stride| stride.0) as u64;
        let stride = if stride == 0 { size } else { stride };
        let offset = accessor.byte_offset.unwrap_or_default().0;
        let start = offset.checked_add(view.byte_offset.unwrap_or_default().0);
        let count = accessor.count.0;
        let length = count.saturating_sub(1).checked_mul(stride).and_then(|x| x.checked_add(size));
        let end = start.zip(length).and_then(|(start, length)| start.checked_add(length));
        let data = start.zip(end).and_then(|(start, end)| {
            buffer.get(usize::try_from(start).ok()?..usize::try_from(end).ok()?)
        });
        match data {
            Some(data) if stride >= size => Ok(Self {
                data,
                count: count as usize,
                stride: stride as usize,
                component,
                is_normalized: accessor.normalized,
            }),
            _ if count == 0 => Err(malformed(location, "at least one value", "none".to_owned())),
            _ => {
                let found = format!("{count} values every {stride} bytes of {}", buffer.len());
                Err(malformed(location, "values within the buffer", found))
            }
        }
    }

    /// Component `axis` of value `row`; requires `row < count`.
    pub(super) fn value(&self, row: usize, axis: usize) -> f64 {
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
        if self.is_normalized { (value / max).max(-1.0) } else { value }
    }
}
