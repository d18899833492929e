#include "smartsurf/record/hdf5/SurfaceLayout.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "smartsurf/record/hdf5/Hdf5Reading.h"

namespace smartsurf::record {
namespace {

constexpr int kMaxMechanisms = 127;  // stored per cell as int8

template <class Number>
void write_grid(hid_t group, const char* name, hid_t type, const scene::SurfaceSpec& surface, hsize_t width,
                const std::vector<Number>& values) {
  const hsize_t size[] = {static_cast<hsize_t>(surface.rows), static_cast<hsize_t>(surface.columns), width};
  const Handle space(H5Screate_simple(width == 1 ? 2 : 3, size, nullptr), H5Sclose, name);
  const Handle properties(H5Pcreate(H5P_DATASET_CREATE), H5Pclose, name);
  check(H5Pset_obj_track_times(properties, false), name);
  const Handle dataset = create_dataset(group, name, type, space, properties);
  check(H5Dwrite(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()), name);
}

template <class Number>
std::vector<Number> read_grid(hid_t group, const char* name, hid_t type, const scene::SurfaceSpec& surface,
                              hsize_t width) {
  const Handle dataset = open_dataset(group, name, width == 1 ? 2 : 3);
  std::vector<hsize_t> size = {static_cast<hsize_t>(surface.rows), static_cast<hsize_t>(surface.columns),
                               width};
  size.resize(width == 1 ? 2 : 3);
  if (extents(dataset) != size)
    throw Hdf5Error(std::string("dataset surface/") + name + " has the wrong size");
  return read_block<Number>(dataset, type, std::vector<hsize_t>(size.size(), 0), size, name);
}

void write_mechanisms(hid_t group, const scene::SurfaceSpec& surface) {
  const Handle mechanisms_group = create_group(group, "mechanisms");
  const std::vector<scene::ActuatorSpec> mechanisms = surface.effective_actuators();
  for (std::size_t m = 0; m < mechanisms.size(); ++m) {
    const Handle mechanism_group = create_group(mechanisms_group, std::to_string(m).c_str());
    write_attribute(mechanism_group, "model", mechanisms[m].model);
    for (const auto& [name, values] : mechanisms[m].values)
      write_attribute(mechanism_group, name.c_str(), H5T_NATIVE_DOUBLE, values.data(), values.size());
  }
}

// An unknown model becomes a pin, so that its cells can still be drawn.
scene::ActuatorSpec read_mechanism(hid_t group, const scene::PinSpec& pin) {
  const scene::ActuatorKind* kind = scene::find_actuator_kind(read_text_attribute(group, "model"));
  if (kind == nullptr) return scene::make_pin_actuator(pin);
  scene::ActuatorSpec spec = kind->default_spec();
  for (const scene::Parameter& parameter : kind->parameters) {
    if (!has_attribute(group, parameter.name.c_str())) continue;
    const Handle attribute(H5Aopen(group, parameter.name.c_str(), H5P_DEFAULT), H5Aclose, parameter.name);
    const Handle space(H5Aget_space(attribute), H5Sclose, parameter.name);
    const hssize_t count = H5Sget_simple_extent_npoints(space);
    const bool variable_count = parameter.type == scene::Parameter::Type::kPointList;
    if (count < 1 || count > 65536 ||
        (!variable_count && spec.has(parameter.name) &&
         static_cast<std::size_t>(count) != spec.numbers(parameter.name).size()))
      throw Hdf5Error("attribute " + parameter.name + " of a mechanism has the wrong size");
    std::vector<double> values(static_cast<std::size_t>(count));
    read_attribute(group, parameter.name.c_str(), H5T_NATIVE_DOUBLE, values.data(),
                   static_cast<hsize_t>(count));
    for (const double value : values)
      if (!parameter.accepts(value))
        throw Hdf5Error("attribute " + parameter.name + " of a mechanism is out of range");
    spec.values[parameter.name] = std::move(values);
  }
  return spec;
}

void read_mechanisms(hid_t group, scene::SurfaceSpec& surface) {
  const Handle mechanisms_group = open_group(group, "mechanisms");
  for (int m = 0; m < kMaxMechanisms && has_link(mechanisms_group, std::to_string(m).c_str()); ++m)
    surface.actuators.push_back(
        read_mechanism(open_group(mechanisms_group, std::to_string(m).c_str()), surface.pin));
}

void read_cell_poses(hid_t group, scene::SurfaceSpec& surface) {
  const auto values = read_grid<double>(group, "place", H5T_NATIVE_DOUBLE, surface, 3);
  for (std::size_t i = 0; i + 2 < values.size(); i += 3) {
    if (!std::isfinite(values[i]) || !std::isfinite(values[i + 1]) || !std::isfinite(values[i + 2]))
      throw Hdf5Error("dataset surface/place is not finite");
    surface.cell_poses.push_back({values[i], values[i + 1], values[i + 2]});
  }
}

void read_cell_mechanisms(hid_t group, scene::SurfaceSpec& surface) {
  surface.actuator_of_cell = read_grid<std::int8_t>(group, "cell", H5T_NATIVE_INT8, surface, 1);
  const int mechanisms = std::max<int>(1, static_cast<int>(surface.actuators.size()));
  for (const std::int8_t index : surface.actuator_of_cell)
    if (index < scene::kEmptyCell || index >= mechanisms)
      throw Hdf5Error("dataset surface/cell has a mechanism index out of range");
}

constexpr const char* kSkinKinds[] = {"kinematic", "elastic"};

void write_skin(hid_t group, const scene::SkinSpec& skin) {
  const Handle skin_group = create_group(group, "skin");
  write_attribute(skin_group, "kind", std::string(kSkinKinds[static_cast<int>(skin.kind)]));
  const double nodes[] = {static_cast<double>(skin.rows), static_cast<double>(skin.columns)};
  write_attribute(skin_group, "nodes", H5T_NATIVE_DOUBLE, nodes, 2);
  write_attribute(skin_group, "margin", H5T_NATIVE_DOUBLE, &skin.margin, 1);
  if (skin.kind == scene::SkinSpec::Kind::kElastic) {
    const double attached = skin.attached ? 1.0 : 0.0;
    write_attribute(skin_group, "tension", H5T_NATIVE_DOUBLE, &skin.tension, 1);
    write_attribute(skin_group, "density", H5T_NATIVE_DOUBLE, &skin.density, 1);
    write_attribute(skin_group, "damping", H5T_NATIVE_DOUBLE, &skin.damping, 1);
    write_attribute(skin_group, "attached", H5T_NATIVE_DOUBLE, &attached, 1);
  }
  if (skin.edge == scene::SkinSpec::Edge::kClamped)
    write_attribute(skin_group, "edge", H5T_NATIVE_DOUBLE, &skin.edge_height, 1);
}

scene::SkinSpec read_skin(hid_t group) {
  scene::SkinSpec skin;
  if (read_text_attribute(group, "kind") == kSkinKinds[1]) skin.kind = scene::SkinSpec::Kind::kElastic;
  double nodes[2] = {};
  read_attribute(group, "nodes", H5T_NATIVE_DOUBLE, nodes, 2);
  for (const double n : nodes)
    if (!(n >= 2 && n <= 4096)) throw Hdf5Error("attribute nodes of surface/skin is out of range");
  skin.rows = static_cast<int>(nodes[0]), skin.columns = static_cast<int>(nodes[1]);
  read_attribute(group, "margin", H5T_NATIVE_DOUBLE, &skin.margin, 1);
  if (has_attribute(group, "edge")) {
    skin.edge = scene::SkinSpec::Edge::kClamped;
    read_attribute(group, "edge", H5T_NATIVE_DOUBLE, &skin.edge_height, 1);
  }
  return skin;
}

}  // namespace

void write_layout(hid_t group, const scene::SurfaceSpec& surface) {
  write_mechanisms(group, surface);
  if (surface.skin) write_skin(group, *surface.skin);
  if (!surface.actuator_of_cell.empty())
    write_grid(group, "cell", H5T_NATIVE_INT8, surface, 1, surface.actuator_of_cell);
  if (!surface.base_heights.empty())
    write_grid(group, "base", H5T_NATIVE_FLOAT, surface, 1, surface.base_heights);
  if (surface.cell_poses.empty()) return;
  std::vector<double> place;
  for (const scene::CellPose& p : surface.cell_poses) place.insert(place.end(), {p.x, p.y, p.angle});
  write_grid(group, "place", H5T_NATIVE_DOUBLE, surface, 3, place);
}

void read_layout(hid_t group, scene::SurfaceSpec& surface) {
  if (has_link(group, "mechanisms")) read_mechanisms(group, surface);
  if (has_link(group, "cell")) read_cell_mechanisms(group, surface);
  if (has_link(group, "base"))
    surface.base_heights = read_grid<float>(group, "base", H5T_NATIVE_FLOAT, surface, 1);
  if (has_link(group, "place")) read_cell_poses(group, surface);
  if (has_link(group, "skin")) surface.skin = read_skin(open_group(group, "skin"));
}

void flatten_actuator_state(std::span<const scene::ActuatorState> motion, std::vector<float>& flat) {
  flat.clear();
  for (const scene::ActuatorState& m : motion) flat.insert(flat.end(), {m.a, m.b, m.level});
}

std::vector<scene::ActuatorState> unflatten_actuator_state(std::span<const float> flat) {
  std::vector<scene::ActuatorState> motion;
  for (std::size_t i = 0; i + 2 < flat.size(); i += kValuesPerActuatorState)
    motion.push_back({flat[i], flat[i + 1], flat[i + 2]});
  return motion;
}

}  // namespace smartsurf::record
