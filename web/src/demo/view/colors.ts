// Colours of the scene, from the style sheet, which defines the light and the dark theme.

import { Color } from "three";

export interface Colors {
  ground: Color;
  accent: Color;
  table: Color;
  plinth: Color;
  line: Color;
  cloud: Color;
  reconstruction: Color;
  force: Color;
  target: Color;
  ink: Color;
  sky: Color;
  // Intensity of the lights, opacity of the shadows.
  light: number;
  shadow: number;
}

export function readColors(): Colors {
  const style = getComputedStyle(document.documentElement);
  const value = (name: string) => style.getPropertyValue(name).trim();
  const color = (name: string) => new Color(value(name));
  return {
    ground: color("--ground"),
    accent: color("--accent"),
    table: color("--scene-table"),
    plinth: color("--scene-plinth"),
    line: color("--scene-line"),
    cloud: color("--scene-cloud"),
    reconstruction: color("--scene-reconstruction"),
    force: color("--scene-force"),
    target: color("--scene-target"),
    ink: color("--ink"),
    sky: color("--scene-sky"),
    light: Number(value("--scene-light")),
    shadow: Number(value("--scene-shadow")),
  };
}

export function onColorsChange(onChange: () => void): void {
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", onChange);
}
