//! Which properties are wanted, and what for.

use super::super::Error;
use super::super::obj::ReadOptions;
use super::super::source::Source;
use super::header::{Element, Header, Kind, Property};

/// What a property is read for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    /// The number is one of [`Values`].
    Value(usize),
    /// The list has the corners of a face.
    Corners,
    /// Nothing.
    Passed,
}

/// An element and a role for each of its properties.
#[derive(Debug)]
pub(super) struct Layout<'a> {
    pub(super) element: &'a Element,
    roles: Vec<Role>,
}

/// What a vertex can have: its place, its normal, its texture coordinates.
pub(super) type Values = [f64; 8];

/// Where in [`Values`] each of them begins.
pub(super) const PLACE: usize = 0;
pub(super) const NORMAL: usize = 3;
pub(super) const UV: usize = 6;

/// Names for texture coordinates that programs write.
const UV_NAMES: [[&str; 2]; 4] = [["s", "t"], ["u", "v"], ["texture_u", "texture_v"], ["texture_s", "texture_t"]];

/// Names for the corners of a face.
const CORNER_NAMES: [&str; 2] = ["vertex_indices", "vertex_index"];

impl<'a> Layout<'a> {
    /// The properties with their roles, in order.
    #[inline]
    pub(super) fn steps(&self) -> impl Iterator<Item = (&'a Property, Role)> {
        self.element.properties.iter().zip(self.roles.iter().copied())
    }

    /// The name of the property that is value `slot`.
    pub(super) fn name(&self, slot: usize) -> &str {
        let at = self.roles.iter().position(|&r| r == Role::Value(slot));
        at.map_or("", |at| &self.element.properties[at].name)
    }

    /// Whether vertices have a value `slot` that is wanted.
    pub(super) fn has(&self, slot: usize) -> bool {
        self.roles.contains(&Role::Value(slot))
    }

    /// Gives the numbers of these names the slots from `first` on, if all are there.
    fn take(&mut self, names: &[&str], first: usize) -> bool {
        let place = |name: &&str| {
            self.element.properties.iter().position(|p| p.name == *name && matches!(p.kind, Kind::One(_)))
        };
        let Some(places) = names.iter().map(place).collect::<Option<Vec<_>>>() else { return false };
        for (slot, place) in places.into_iter().enumerate() {
            self.roles[place] = Role::Value(first + slot);
        }
        true
    }

    /// Nothing of it is wanted.
    pub(super) fn passed(element: &'a Element) -> Self {
        Self { element, roles: vec![Role::Passed; element.properties.len()] }
    }

    /// Where vertices have what is wanted of them.
    pub(super) fn of_vertices(element: &'a Element, source: &Source, options: &ReadOptions<'_>) -> Result<Self, Error> {
        let mut layout = Self::passed(element);
        for (slot, name) in ["x", "y", "z"].into_iter().enumerate() {
            if !layout.take(&[name], PLACE + slot) {
                return Err(
                    element.wrong(source, format!("element 'vertex' has no property '{name}' that is a number"))
                );
            }
        }
        if options.normals {
            layout.take(&["nx", "ny", "nz"], NORMAL);
        }
        if options.wants_uv(&[]) {
            UV_NAMES.iter().any(|names| layout.take(names, UV));
        }
        Ok(layout)
    }

    /// Where faces have their corners.
    pub(super) fn of_faces(element: &'a Element, source: &Source) -> Result<Self, Error> {
        let mut layout = Self::passed(element);
        let Some(at) = element.properties.iter().position(|p| CORNER_NAMES.contains(&&*p.name)) else {
            let what = "element 'face' has no property 'vertex_indices' or 'vertex_index'";
            return Err(element.wrong(source, what.into()));
        };
        let property = &element.properties[at];
        if !matches!(property.kind, Kind::List { item, .. } if item.is_whole()) {
            let what = format!("property '{}' must be a list of whole numbers", property.name);
            return Err(Error::At { path: source.path.clone(), line: property.line, column: 1, what });
        }
        layout.roles[at] = Role::Corners;
        Ok(layout)
    }
}

/// The line of the header that says vertices have a colour, if they do.
pub(super) fn colour_line(header: &Header) -> Option<u64> {
    let vertex = header.element("vertex")?;
    vertex.properties.iter().find(|p| ["red", "diffuse_red"].contains(&&*p.name)).map(|p| p.line)
}
