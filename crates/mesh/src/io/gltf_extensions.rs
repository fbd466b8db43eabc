//! glTF extensions: those that change the geometry are read or refused by name.

use super::accessor::AccessorView;
use super::gltf::{malformed, unsupported};
use super::parse::check_limit;
use crate::{Location, MeshError};
use glamx::{DMat4, DQuat, DVec3};
use gltf::json::accessor::Type;
use gltf::json::{Accessor, Index, Node, Root};
use std::borrow::Cow;

const INSTANCING: &str = "EXT_mesh_gpu_instancing";
/// Extensions that this reader implements.
const IMPLEMENTED: [&str; 2] = ["KHR_mesh_quantization", INSTANCING];
/// Prefixes of the extensions that change only the appearance.
const APPEARANCE: [&str; 9] = [
    "KHR_materials_",
    "KHR_texture_",
    "KHR_lights_",
    "KHR_xmp",
    "EXT_texture_",
    "EXT_lights_",
    "EXT_materials_",
    "MSFT_texture_",
    "ADOBE_materials_",
];
/// Extensions that compress the geometry.
const COMPRESSIONS: [&str; 3] =
    ["KHR_draco_mesh_compression", "KHR_meshopt_compression", "EXT_meshopt_compression"];
/// Max number of instances of a node.
const MAX_INSTANCES: usize = 100_000;

/// Fails if the file requires an extension that this reader does not know.
pub(super) fn check_required(root: &Root) -> Result<(), MeshError> {
    let is_known = |name: &str| {
        IMPLEMENTED.contains(&name) || APPEARANCE.iter().any(|prefix| name.starts_with(prefix))
    };
    match root.extensions_required.iter().find(|name| !is_known(name)) {
        Some(name) => Err(unsupported(feature(name))),
        None => Ok(()),
    }
}

/// Fails if the file uses compression; called where its geometry is missing.
pub(super) fn check_compression(root: &Root) -> Result<(), MeshError> {
    match root.extensions_used.iter().find(|name| COMPRESSIONS.contains(&&name[..])) {
        Some(name) => Err(unsupported(feature(name))),
        None => Ok(()),
    }
}

fn feature(name: &str) -> String {
    let name: String = name.chars().filter(|c| !c.is_control()).take(80).collect();
    match COMPRESSIONS.contains(&&name[..]) {
        true => format!("compression ({name})"),
        false => format!("the extension {name}"),
    }
}

/// Transforms `node_from_instance` of a node with `EXT_mesh_gpu_instancing`; `None` without it.
pub(super) fn instance_transforms(
    root: &Root,
    buffers: &[Option<Cow<'_, [u8]>>],
    node: &Node,
) -> Result<Option<Vec<DMat4>>, MeshError> {
    let extensions = node.extensions.as_ref();
    let Some(instancing) = extensions.and_then(|extensions| extensions.others.get(INSTANCING))
    else {
        return Ok(None);
    };
    let view = |name: &str, kind: Type| {
        let Some(value) = instancing.get("attributes").and_then(|all| all.get(name)) else {
            return Ok(None);
        };
        let index = value.as_u64().and_then(|index| u32::try_from(index).ok());
        let index = index.ok_or_else(|| {
            malformed(Location::Entry(INSTANCING, 0), "an accessor index", value.to_string())
        })?;
        AccessorView::new(root, buffers, Index::<Accessor>::new(index), kind).map(Some)
    };
    let translations = view("TRANSLATION", Type::Vec3)?;
    let rotations = view("ROTATION", Type::Vec4)?;
    let scales = view("SCALE", Type::Vec3)?;
    let views = [&translations, &rotations, &scales].map(|view| view.as_ref());
    let count = views.into_iter().flatten().map(|view| view.count).min().unwrap_or(0);
    check_limit("instances", count as u64, MAX_INSTANCES)?;
    let vector = |view: &Option<AccessorView<'_>>, row: usize, default: DVec3| {
        let components = |view: &AccessorView<'_>| [0, 1, 2].map(|axis| view.value(row, axis));
        view.as_ref().map_or(default, |view| DVec3::from_array(components(view)))
    };
    let transform = |row: usize| {
        let rotation = rotations.as_ref().map_or(DQuat::IDENTITY, |view| {
            DQuat::from_array([0, 1, 2, 3].map(|axis| view.value(row, axis))).normalize()
        });
        DMat4::from_scale_rotation_translation(
            vector(&scales, row, DVec3::ONE),
            rotation,
            vector(&translations, row, DVec3::ZERO),
        )
    };
    Ok(Some((0..count).map(transform).collect()))
}
