#include "smartsurf/web/SceneJson.h"

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "common/color/Palette.h"
#include "smartsurf/scene/Delta.h"
#include "smartsurf/scene/PinTip.h"
#include "smartsurf/view/model/ActuatorGeometry.h"
#include "smartsurf/view/model/Palette.h"
#include "smartsurf/view/model/PinShading.h"
#include "smartsurf/web/Base64.h"

namespace smartsurf::web {
namespace {

using nlohmann::json;

constexpr const char* kShapeNames[] = {"sphere", "box", "cylinder", "capsule", "cone", "solid"};

json objects_json(std::span<const scene::ObjectSpec> specs) {
  json objects = json::array();
  for (const scene::ObjectSpec& object : specs) {
    const Eigen::Vector3d half = object.half_extents();
    json entry = {{"shape", kShapeNames[static_cast<int>(object.shape)]},
                  {"half", {half.x(), half.y(), half.z()}},
                  {"radius", object.radius},
                  {"height", object.height},
                  {"colour", {object.colour.r, object.colour.g, object.colour.b}},
                  {"label", object.label}};
    if (object.solid && object.shape == scene::ShapeKind::kSolid) {
      json vertices = json::array(), triangles = json::array();
      for (const Eigen::Vector3f& v : object.solid->vertices)
        vertices.insert(vertices.end(), {v.x(), v.y(), v.z()});
      for (const auto& t : object.solid->triangles) triangles.insert(triangles.end(), {t[0], t[1], t[2]});
      entry["vertices"] = std::move(vertices);
      entry["triangles"] = std::move(triangles);
    }
    objects.push_back(std::move(entry));
  }
  return objects;
}

// x, y and angle of each cell of a free layout; null for a rectangular grid.
json cell_poses_json(const scene::SurfaceSpec& surface) {
  if (surface.cell_poses.empty()) return {};
  json poses = json::array();
  for (const scene::CellPose& pose : surface.cell_poses)
    poses.insert(poses.end(), {pose.x, pose.y, pose.angle});
  return poses;
}

json mesh_json(const view::InstancedMesh& mesh) {
  const std::vector<float>& vertices = mesh.mesh.vertices;
  const auto* const bytes = reinterpret_cast<const std::uint8_t*>(vertices.data());
  return {{"vertices", base64({bytes, sizeof(float) * vertices.size()})},
          {"indices", mesh.mesh.indices},
          {"size", {mesh.size.x(), mesh.size.y(), mesh.size.z()}},
          {"translucent", mesh.translucent}};
}

// The mesh of a skin, whose nodes are row-major, row 0 north, and its first and last nodes around the tops of
// each row and column of cells; null without one.
json skin_json(const scene::SurfaceSpec& surface, const view::ActuatorGeometry& geometry) {
  if (!surface.skin) return {};
  const auto ranges = [](std::span<const view::ActuatorGeometry::NodeRange> nodes) {
    json all = json::array();
    for (const auto& [first, last] : nodes) all.push_back({first, last});
    return all;
  };
  return {{"columns", surface.skin->columns},
          {"mesh", mesh_json(geometry.meshes().back())},
          {"rowNodes", ranges(geometry.node_rows())},
          {"columnNodes", ranges(geometry.node_columns())}};
}

json actuators_json(const scene::SurfaceSpec& surface, const view::ActuatorGeometry& geometry) {
  json actuators = json::array();
  const std::vector<scene::ActuatorSpec> specs = surface.effective_actuators();
  for (std::size_t m = 0; m < specs.size(); ++m) {
    const scene::ActuatorSpec& spec = specs[m];
    json actuator = {{"model", spec.model}, {"meshes", json::array()}};
    for (const auto& [name, values] : spec.values) actuator[name] = values;
    for (const view::InstancedMesh& mesh : geometry.meshes_of(m))
      actuator["meshes"].push_back(mesh_json(mesh));
    // With the defaults that depend on other values filled in.
    if (spec.model == "pin") {
      const scene::PinTip tip = scene::pin_tip(spec, surface.pin.top_x, surface.pin.top_y);
      actuator["tip"] = {{"height", tip.height}};
    } else if (spec.model == "delta") {
      const scene::Delta delta(spec);
      actuator["tip"] = {{"length", delta.tip_length}};
      actuator["arms"] = {{"radius", delta.joint_radius}, {"length", delta.arm_length}};
    }
    actuators.push_back(std::move(actuator));
  }
  return actuators;
}

json colours_json() {
  json colours = {{"lowest_pin", view::kLowestPinColour},
                  {"highest_pin", view::kHighestPinColour},
                  {"border", view::kBorderColour},
                  {"no_value", view::kNanColour}};
  for (const auto& [name, colour] : view::actuator_colours()) colours[name] = colour;
  return colours;
}

// Equidistant samples of viridis, sRGB in bytes.
json palette_json() {
  constexpr int kSamples = 33;
  json samples = json::array();
  for (int i = 0; i < kSamples; ++i) {
    const common::Rgb c =
        common::palette_color(common::Palette::kViridis, static_cast<float>(i) / (kSamples - 1));
    samples.push_back({view::to_byte(c[0]), view::to_byte(c[1]), view::to_byte(c[2])});
  }
  return samples;
}

json looks_json() {
  json looks = {{"lowered_wall", view::kLoweredWall}};
  for (const auto& [name, value] : view::actuator_looks()) looks[name] = value;
  return looks;
}

}  // namespace

json scene_json(const scene::SceneSpec& spec, std::span<const scene::ObjectSpec> objects) {
  const scene::SurfaceSpec& s = spec.surface;
  const view::ActuatorGeometry geometry(s);
  return {{"title", std::filesystem::path(spec.file).filename().string()},
          {"seed", spec.world.seed},
          {"rows", s.rows},
          {"columns", s.columns},
          {"pitch", s.pitch},
          {"top", {s.pin.top_x, s.pin.top_y}},
          {"length", s.pin.length},
          {"low", s.pin.min_height},
          {"high", s.pin.max_height},
          {"border", s.border_height ? json(*s.border_height) : json()},
          {"place", cell_poses_json(s)},
          {"narrowGaps", s.has_narrow_gaps()},
          {"hexagonal", s.has_hexagonal_tops()},
          {"skin", skin_json(s, geometry)},
          {"cell", s.actuator_of_cell.empty() ? json() : json(s.actuator_of_cell)},
          {"mechanisms", actuators_json(s, geometry)},
          {"colours", colours_json()},
          {"palette", palette_json()},
          {"looks", looks_json()},
          {"objects", objects_json(objects)}};
}

}  // namespace smartsurf::web
