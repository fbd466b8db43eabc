//! A drawing in SVG: shapes one over the other.

use std::fmt::Write;

/// A drawing of a size in pixels; y points down.
pub struct Canvas {
    width: f32,
    height: f32,
    shapes: String,
}

impl Canvas {
    /// An empty one.
    pub fn new(width: f32, height: f32) -> Self {
        Self { width, height, shapes: String::new() }
    }

    fn push(&mut self, shape: std::fmt::Arguments) {
        // Writing to a string cannot fail.
        self.shapes.write_fmt(shape).ok();
        self.shapes.push('\n');
    }

    /// A filled polygon.
    pub fn polygon(&mut self, points: &[[f32; 2]], fill: &str) {
        let points = joined(points);
        // Its own colour on its edge closes the seams between neighbours.
        self.push(format_args!(
            r#"<polygon points="{points}" fill="{fill}" stroke="{fill}" stroke-width=".4"/>"#
        ));
    }

    /// A line through points.
    pub fn path(&mut self, points: &[[f32; 2]], stroke: &str, width: f32) {
        let points = joined(points);
        self.push(format_args!(
            r#"<polyline points="{points}" fill="none" stroke="{stroke}" stroke-width="{width}"/>"#
        ));
    }

    /// A filled circle.
    pub fn circle(&mut self, [x, y]: [f32; 2], radius: f32, fill: &str) {
        self.push(format_args!(r#"<circle cx="{x:.1}" cy="{y:.1}" r="{radius}" fill="{fill}"/>"#));
    }

    /// A filled rectangle, from its upper left corner.
    pub fn rectangle(&mut self, [x, y]: [f32; 2], [width, height]: [f32; 2], fill: &str) {
        self.push(format_args!(
            r#"<rect x="{x:.1}" y="{y:.1}" width="{width:.1}" height="{height:.1}" fill="{fill}"/>"#
        ));
    }

    /// Text that begins at a point.
    pub fn text(&mut self, [x, y]: [f32; 2], size: f32, fill: &str, text: &str) {
        let text = escaped(text);
        self.push(format_args!(
            r#"<text x="{x:.1}" y="{y:.1}" font-size="{size}" fill="{fill}">{text}</text>"#
        ));
    }

    /// Puts another drawing with its upper left corner at a point.
    pub fn place(&mut self, [x, y]: [f32; 2], other: &Self) {
        self.push(format_args!(r#"<g transform="translate({x:.1} {y:.1})">"#));
        self.shapes.push_str(&other.shapes);
        self.push(format_args!("</g>"));
    }

    /// The drawing, for screen readers with a title.
    pub fn svg(&self, title: &str) -> String {
        let Self { width, height, shapes } = self;
        let title = escaped(title);
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
             viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\" role=\"img\">\n\
             <title>{title}</title>\n{shapes}</svg>\n"
        )
    }
}

fn joined(points: &[[f32; 2]]) -> String {
    let words: Vec<String> = points.iter().map(|[x, y]| format!("{x:.1},{y:.1}")).collect();
    words.join(" ")
}

/// Text as HTML and SVG take it.
pub(crate) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_cannot_break_out_of_a_drawing() {
        let mut canvas = Canvas::new(10.0, 20.0);
        canvas.text([1.0, 2.0], 3.0, "black", "</svg><script>");
        let svg = canvas.svg("a \"b\" & c");
        assert!(svg.starts_with("<svg") && svg.ends_with("</svg>\n"));
        assert!(!svg.contains("<script>") && svg.contains("a &quot;b&quot; &amp; c"));
    }
}
