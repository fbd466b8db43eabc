//! Tree of XML elements. `build.rs` writes that of the standard robot as JSON, so that the web build needs no
//! XML parser (8 kB as sent).

use roxmltree::{Document, Node};
use serde::{Deserialize, Serialize};

/// An XML element, without text and comments.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Element {
    pub(crate) name: String,
    /// Line in the file, from 1.
    pub(crate) line: u32,
    /// Names and values.
    pub(crate) attributes: Vec<(String, String)>,
    pub(crate) children: Vec<Element>,
}

impl Element {
    /// Parses a document and returns its root.
    pub(crate) fn parse(text: &str) -> Result<Self, roxmltree::Error> {
        Ok(Self::read(Document::parse(text)?.root_element()))
    }

    fn read(node: Node) -> Self {
        Self {
            name: node.tag_name().name().to_owned(),
            line: node.document().text_pos_at(node.range().start).row,
            attributes: node.attributes().map(|a| (a.name().into(), a.value().into())).collect(),
            children: node.children().filter(Node::is_element).map(Self::read).collect(),
        }
    }
}
