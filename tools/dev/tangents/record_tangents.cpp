// record_tangents ASSET FIRST COUNT OUT.bin: COUNT triangles of an asset's first mesh with UVs, from FIRST
// on, with the tangents that the reference implementation of MikkTSpace gives their corners. README.md says
// how to build it.
//
// OUT.bin, little-endian: u32 vertices, u32 triangles; per vertex 8 f32 (position, normal, UV as glTF has
// it); per triangle 3 u32; per corner 4 f32 (tangent, sign), zeros where the reference has no tangent.
#include <algorithm>
#include <cstring>

#include "console/program.h"
#include "mikktspace.h"
#include "patina/asset/asset.h"
#include "patina/asset/geometry.h"
#include "patina/base/files.h"

namespace {

using namespace patina;
using asset::Geometry;

struct Job {
  const Geometry& geometry;
  std::vector<vec4> tangents;  // one a corner

  static Job& of(const SMikkTSpaceContext* context) { return *static_cast<Job*>(context->m_pUserData); }
  uint32_t vertex(int face, int corner) const {
    return geometry.triangles[static_cast<size_t>(face)][corner];
  }
};

void copy(const vec3& from, float to[]) {
  to[0] = from.x, to[1] = from.y, to[2] = from.z;
}

// v grows downwards here: the sign turns.
std::vector<vec4> reference_tangents(const Geometry& geometry) {
  SMikkTSpaceInterface functions{};
  functions.m_getNumFaces = [](const SMikkTSpaceContext* c) {
    return static_cast<int>(Job::of(c).geometry.triangles.size());
  };
  functions.m_getNumVerticesOfFace = [](const SMikkTSpaceContext*, int) { return 3; };
  functions.m_getPosition = [](const SMikkTSpaceContext* c, float out[], int face, int corner) {
    copy(Job::of(c).geometry.position[Job::of(c).vertex(face, corner)], out);
  };
  functions.m_getNormal = [](const SMikkTSpaceContext* c, float out[], int face, int corner) {
    copy(Job::of(c).geometry.normal[Job::of(c).vertex(face, corner)], out);
  };
  functions.m_getTexCoord = [](const SMikkTSpaceContext* c, float out[], int face, int corner) {
    const vec2 uv = Job::of(c).geometry.uv[0][Job::of(c).vertex(face, corner)];
    out[0] = uv.x, out[1] = uv.y;
  };
  functions.m_setTSpaceBasic = [](const SMikkTSpaceContext* c, const float t[], float sign, int face,
                                  int corner) {
    const vec4 tangent(t[0], t[1], t[2], -sign);
    // What the reference begins with and leaves where nothing tells a direction.
    const bool is_default = tangent == vec4(1, 0, 0, 1);
    Job::of(c).tangents[static_cast<size_t>(3 * face + corner)] = is_default ? vec4(0.0f) : tangent;
  };
  Job job{geometry, std::vector<vec4>(3 * geometry.triangles.size())};
  SMikkTSpaceContext context{&functions, &job};
  genTangSpaceDefault(&context);
  return job.tangents;
}

Geometry part_of(const std::filesystem::path& path, size_t first, size_t count) {
  const asset::Asset asset = asset::read_asset(path);
  const auto with_uvs = std::find_if(asset.primitives.begin(), asset.primitives.end(),
                                     [](const asset::Primitive& p) { return !p.uv.empty(); });
  if (with_uvs == asset.primitives.end()) throw std::runtime_error(path.string() + " has no UVs");
  Geometry whole;
  whole.position = with_uvs->p_world, whole.normal = with_uvs->n_world, whole.uv = {with_uvs->uv[0]};
  std::vector<uint32_t> source;
  std::vector<uvec3> triangles;
  std::vector<int64_t> number(whole.num_vertices(), -1);
  for (size_t t = first; t < std::min(first + count, with_uvs->triangles.size()); ++t) {
    uvec3& triangle = triangles.emplace_back();
    for (int k = 0; k < 3; ++k) {
      int64_t& known = number[with_uvs->triangles[t][k]];
      if (known < 0) known = static_cast<int64_t>(source.size()), source.push_back(with_uvs->triangles[t][k]);
      triangle[k] = static_cast<uint32_t>(known);
    }
  }
  return gathered(whole, source, triangles);
}

void record(const Geometry& geometry, const std::filesystem::path& out) {
  std::vector<uint8_t> bytes;
  const auto add = [&](const auto& value) {
    const auto* begin = reinterpret_cast<const uint8_t*>(&value);
    bytes.insert(bytes.end(), begin, begin + sizeof value);
  };
  add(static_cast<uint32_t>(geometry.num_vertices()));
  add(static_cast<uint32_t>(geometry.triangles.size()));
  for (size_t i = 0; i < geometry.num_vertices(); ++i)
    add(geometry.position[i]), add(geometry.normal[i]), add(geometry.uv[0][i]);
  for (const uvec3& triangle : geometry.triangles) add(triangle);
  for (const vec4& tangent : reference_tangents(geometry)) add(tangent);
  write_file(out, std::span<const uint8_t>(bytes));
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App program("Records what the reference implementation of MikkTSpace gives.", "record_tangents");
  std::filesystem::path asset, out;
  size_t first = 0, count = 0;
  program.add_option("ASSET", asset, "With UVs")->required();
  program.add_option("FIRST", first, "Triangle")->required();
  program.add_option("COUNT", count, "Of triangles")->required();
  program.add_option("OUT.bin", out, "File to write")->required();
  return tools::run_program(program, argc, argv, [&] { record(part_of(asset, first, count), out); });
}
