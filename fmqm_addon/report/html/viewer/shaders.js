"use strict";
// What a graphics card does: a surface in its own colors, or painted by a result.
fmqmViewer.shaders = {
  vertex: `
    attribute vec3 tint;
    varying vec3 at, seen, facing, light;
    varying vec2 place;

    void main() {
      at = position;
      place = uv;
      light = mix(tint / 12.92, pow((tint + 0.055) / 1.055, vec3(2.4)), step(0.04045, tint));
      facing = normalMatrix * normal;
      vec4 eye = modelViewMatrix * vec4(position, 1.0);
      seen = eye.xyz;
      gl_Position = projectionMatrix * eye;
    }`,

  fragment: `
    precision highp sampler3D;
    precision highp usampler3D;
    varying vec3 at, seen, facing, light;
    varying vec2 place;
    uniform sampler2D image, ramp, patches;
    uniform sampler3D cells;
    uniform usampler3D candidates;
    uniform bool hasImage, lit, heat, wire, partial, ofPatches;
    uniform vec3 gridLow, cellsLow, cellsSpan;
    uniform float gridSize, low, high;
    uniform int field;

    vec3 ownColor() {
      if (hasImage) return texture2D(image, place).rgb;
      return mix(light * 12.92, 1.055 * pow(light, vec3(1.0 / 2.4)) - 0.055, step(0.0031308, light));
    }

    // The value of the patch whose center is nearest.
    float patchValue() {
      ivec3 cell = clamp(ivec3((at - gridLow) / gridSize), ivec3(0), textureSize(candidates, 0) - 1);
      uvec4 few = texelFetch(candidates, cell, 0);
      float nearest = 1e9, value = 0.0;
      for (int k = 0; k < 4; k++) {
        vec4 each = texelFetch(patches, ivec2(int(few[k]), 0), 0);
        vec3 away = each.xyz - at;
        float squared = dot(away, away);
        if (squared < nearest) {
          nearest = squared;
          value = each.w;
        }
      }
      return value;
    }

    vec3 heatColor() {
      vec4 sampled = texture(cells, (at - cellsLow) / cellsSpan);
      bool known = sampled.b > 0.02;
      if (ofPatches ? partial && !known : !known) {
        return mix(vec3(dot(ownColor(), vec3(0.3, 0.6, 0.1))), vec3(0.5), 0.5); // not measured: dimmed
      }
      float value = ofPatches ? patchValue() : (field == 0 ? sampled.r : sampled.g) / sampled.b * high;
      float share = clamp((value - low) / (high - low), 0.0, 1.0);
      return texture2D(ramp, vec2(((ofPatches ? share : 1.0 - share) * 32.0 + 0.5) / 33.0, 0.5)).rgb;
    }

    void main() {
      vec3 color = heat ? heatColor() : ownColor();
      if (wire) {
        bool dark = dot(color, vec3(0.3, 0.6, 0.1)) < 0.45;
        gl_FragColor = vec4(vec3(dark ? 1.0 : 0.0), 0.35);
        return;
      }
      if (lit) {
        vec3 normal = normalize(facing);
        if (dot(normal, cross(dFdx(seen), dFdy(seen))) < 0.0) normal = -normal; // both sides of a face are seen
        float ambient = heat ? 0.65 : 0.5;
        color *= ambient + (1.0 - ambient) * max(dot(normal, normalize(vec3(-0.45, 0.55, 1.0))), 0.0);
      }
      gl_FragColor = vec4(color, 1.0);
    }`,
};
