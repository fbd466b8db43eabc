//! Minimal SVG canvas.

use std::fmt::Write;

/// SVG drawing, size in pixels, y axis down. Later shapes cover earlier ones.
pub struct Canvas {
    width: f32,
    height: f32,
    shapes: String,
}

impl Canvas {
    /// Creates an empty drawing.
    pub fn new(width: f32, height: f32) -> Self {
        Self { width, height, shapes: String::new() }
    }

    fn push(&mut self, shape: std::fmt::Arguments) {
        // Writing to a string cannot fail.
        self.shapes.write_fmt(shape).ok();
        self.shapes.push('\n');
    }

    /// Adds a filled polygon.
    pub fn polygon(&mut self, points: &[[f32; 2]], fill: &str) {
        let points = format_points(points);
        // A stroke in the fill color closes the seams between adjacent polygons.
        self.push(format_args!(
            r#"<polygon points="{points}" fill="{fill}" stroke="{fill}" stroke-width=".4"/>"#
        ));
    }

    /// Adds a polyline.
    pub fn polyline(&mut self, points: &[[f32; 2]], stroke: &str, width: f32) {
        let points = format_points(points);
        self.push(format_args!(
            r#"<polyline points="{points}" fill="none" stroke="{stroke}" stroke-width="{width}"/>"#
        ));
    }

    /// Adds a filled circle.
    pub fn circle(&mut self, [x, y]: [f32; 2], radius: f32, fill: &str) {
        self.push(format_args!(r#"<circle cx="{x:.1}" cy="{y:.1}" r="{radius}" fill="{fill}"/>"#));
    }

    /// Adds a filled rectangle, given its upper left corner and its size.
    pub fn rectangle(&mut self, [x, y]: [f32; 2], [width, height]: [f32; 2], fill: &str) {
        self.push(format_args!(
            r#"<rect x="{x:.1}" y="{y:.1}" width="{width:.1}" height="{height:.1}" fill="{fill}"/>"#
        ));
    }

    /// Adds text that starts at a point.
    pub fn text(&mut self, [x, y]: [f32; 2], size: f32, fill: &str, text: &str) {
        let text = escape_xml(text);
        self.push(format_args!(
            r#"<text x="{x:.1}" y="{y:.1}" font-size="{size}" fill="{fill}">{text}</text>"#
        ));
    }

    /// Embeds another drawing with its upper left corner at a point.
    pub fn embed(&mut self, [x, y]: [f32; 2], other: &Self) {
        self.push(format_args!(r#"<g transform="translate({x:.1} {y:.1})">"#));
        self.shapes.push_str(&other.shapes);
        self.push(format_args!("</g>"));
    }

    /// SVG source with a title for screen readers.
    pub fn svg(&self, title: &str) -> String {
        let Self { width, height, shapes } = self;
        let title = escape_xml(title);
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
             viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\" role=\"img\">\n\
             <title>{title}</title>\n{shapes}</svg>\n"
        )
    }
}

fn format_points(points: &[[f32; 2]]) -> String {
    let words: Vec<String> = points.iter().map(|[x, y]| format!("{x:.1},{y:.1}")).collect();
    words.join(" ")
}

/// Escapes text for HTML and SVG.
pub fn escape_xml(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_escaped_in_svg() {
        let mut canvas = Canvas::new(10.0, 20.0);
        canvas.text([1.0, 2.0], 3.0, "black", "</svg><script>");
        let svg = canvas.svg("a \"b\" & c");
        assert!(svg.starts_with("<svg") && svg.ends_with("</svg>\n"));
        assert!(!svg.contains("<script>") && svg.contains("a &quot;b&quot; &amp; c"));
    }
}
