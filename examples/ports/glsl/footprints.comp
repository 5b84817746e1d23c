// Stage lights.footprints: the surface that each pixel light of one map stands for, Omega d^2 / cos of its texel, times T/N w.
// A directional light has its texels' perpendicular areas for Omega, and no d^2.
layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer Positions { float lights_position[]; };
layout(std430, binding = 1) readonly buffer Normals { float lights_normal[]; };
layout(std430, binding = 2) readonly buffer Texels { int lights_texel[]; };
layout(std430, binding = 3) readonly buffer Maps { int lights_map[]; };
layout(std430, binding = 4) readonly buffer SolidAngles { float solid_angle[]; };
layout(std430, binding = 5) readonly buffer Chosen { int chosen_texel[]; };
layout(std430, binding = 6) readonly buffer Weights { float chosen_weight[]; };
layout(std430, binding = 7) buffer Areas { float lights_area[]; };
uniform uint light_count, chosen_count;
uniform int map, near;
uniform vec3 lamp;  // its place, or where a directional one shines

void main() {
    uint k = gl_GlobalInvocationID.x;
    if (k >= light_count || lights_map[k] != map) return;
    vec3 x = vec3(lights_position[k], lights_position[k + light_count], lights_position[k + 2u * light_count]);
    vec3 n = vec3(lights_normal[k], lights_normal[k + light_count], lights_normal[k + 2u * light_count]);
    vec3 away = near != 0 ? lamp - x : -lamp;
    float square = dot(away, away), cosine = abs(dot(away, n)) / sqrt(square), weight = 0.0;
    for (uint j = 0u; j < chosen_count; ++j)
        if (chosen_texel[j] == lights_texel[k]) weight = chosen_weight[j];
    lights_area[k] = solid_angle[lights_texel[k]] * weight * (near != 0 ? square : 1.0) / max(cosine, 1e-3);
}
