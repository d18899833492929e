#include "smartsurf/record/hdf5/SurfaceLayout.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "smartsurf/record/hdf5/AttributeArchive.h"
#include "smartsurf/record/hdf5/Hdf5Reading.h"
#include "smartsurf/scene/KindRegistry.h"

namespace smartsurf::record {
namespace {

constexpr int kMaxMechanisms = 127;  // stored per cell as int8
constexpr const char *kMechanisms = "mechanisms", *kModel = "model", *kSkin = "skin", *kCell = "cell",
                     *kBase = "base", *kPlace = "place";

template <class Number>
void write_grid(hid_t group, const char* name, const scene::SurfaceSpec& surface, hsize_t width,
                const std::vector<Number>& values) {
  const hsize_t size[] = {static_cast<hsize_t>(surface.rows), static_cast<hsize_t>(surface.columns), width};
  write_dataset(group, name, std::span(size).first(width == 1 ? 2 : 3), native_type<Number>(), values.data());
}

template <class Number>
std::vector<Number> read_grid(hid_t group, const char* name, const scene::SurfaceSpec& surface,
                              hsize_t width) {
  const Handle dataset = open_dataset(group, name, width == 1 ? 2 : 3);
  std::vector<hsize_t> size = {static_cast<hsize_t>(surface.rows), static_cast<hsize_t>(surface.columns),
                               width};
  size.resize(width == 1 ? 2 : 3);
  if (extents(dataset) != size)
    throw Hdf5Error(std::string("dataset surface/") + name + " has the wrong size");
  return read_block<Number>(dataset, std::vector<hsize_t>(size.size(), 0), size, name);
}

void write_mechanisms(hid_t group, const scene::SurfaceSpec& surface) {
  const Handle mechanisms_group = create_group(group, kMechanisms);
  const std::vector<scene::ActuatorSpec> mechanisms = surface.effective_actuators();
  for (std::size_t m = 0; m < mechanisms.size(); ++m) {
    const Handle mechanism_group = create_group(mechanisms_group, std::to_string(m).c_str());
    write_attribute(mechanism_group, kModel, mechanisms[m].model);
    for (const auto& [name, values] : mechanisms[m].values)
      write_attribute(mechanism_group, name.c_str(), H5T_NATIVE_DOUBLE, values.data(), values.size());
  }
}

// An unknown model becomes a pin, so that its cells can still be drawn.
scene::ActuatorSpec read_mechanism(hid_t group, const scene::PinSpec& pin) {
  const scene::ActuatorKind* kind = scene::find_actuator_kind(read_text_attribute(group, kModel));
  if (kind == nullptr) return scene::make_pin_actuator(pin);
  scene::ActuatorSpec spec = kind->default_spec();
  for (const scene::Parameter& parameter : kind->parameters) {
    if (!has_attribute(group, parameter.name.c_str())) continue;
    const Handle attribute(H5Aopen(group, parameter.name.c_str(), H5P_DEFAULT), H5Aclose, parameter.name);
    const Handle space(H5Aget_space(attribute), H5Sclose, parameter.name);
    const hssize_t count = H5Sget_simple_extent_npoints(space);
    const bool variable_count = parameter.type == scene::Parameter::Type::kPointList;
    if (count < 1 || count > 65536 ||
        (!variable_count && spec.has(parameter.name) && count != std::ssize(spec.numbers(parameter.name))))
      throw Hdf5Error("attribute " + parameter.name + " of a mechanism has the wrong size");
    std::vector<double> values(count);
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
  const Handle mechanisms_group = open_group(group, kMechanisms);
  for (int m = 0; m < kMaxMechanisms && has_link(mechanisms_group, std::to_string(m).c_str()); ++m)
    surface.actuators.push_back(
        read_mechanism(open_group(mechanisms_group, std::to_string(m).c_str()), surface.pin));
}

void read_cell_poses(hid_t group, scene::SurfaceSpec& surface) {
  const auto values = read_grid<double>(group, kPlace, surface, 3);
  for (std::size_t i = 0; i + 2 < values.size(); i += 3) {
    if (!std::isfinite(values[i]) || !std::isfinite(values[i + 1]) || !std::isfinite(values[i + 2]))
      throw Hdf5Error("dataset surface/place is not finite");
    surface.cell_poses.push_back({values[i], values[i + 1], values[i + 2]});
  }
}

void read_cell_mechanisms(hid_t group, scene::SurfaceSpec& surface) {
  surface.actuator_of_cell = read_grid<std::int8_t>(group, kCell, surface, 1);
  const int mechanisms = std::max<int>(1, static_cast<int>(surface.actuators.size()));
  for (const std::int8_t index : surface.actuator_of_cell)
    if (index < scene::kEmptyCell || index >= mechanisms)
      throw Hdf5Error("dataset surface/cell has a mechanism index out of range");
}

constexpr const char* kSkinKinds[] = {"kinematic", "elastic"};

// The drawn skin; the properties of an elastic one are written only.
template <class Archive, class Skin>
void archive_skin(const Archive& a, Skin& skin) {
  using Spec = scene::SkinSpec;
  std::string kind = kSkinKinds[static_cast<int>(skin.kind)];
  std::array<double, 2> nodes{static_cast<double>(skin.rows), static_cast<double>(skin.columns)};
  std::optional<double> edge;
  if (skin.edge == Spec::Edge::kClamped) edge = skin.edge_height;
  a("kind", kind);
  a("nodes", nodes);
  a("margin", skin.margin);
  a("edge", edge);
  if constexpr (Archive::kReads) {
    if (kind == kSkinKinds[1]) skin.kind = Spec::Kind::kElastic;
    for (const double n : nodes)
      if (!(n >= 2 && n <= 4096)) throw Hdf5Error("attribute nodes of surface/skin is out of range");
    skin.rows = static_cast<int>(nodes[0]), skin.columns = static_cast<int>(nodes[1]);
    if (edge) skin.edge = Spec::Edge::kClamped, skin.edge_height = *edge;
  } else if (skin.kind == Spec::Kind::kElastic) {
    a("tension", skin.tension);
    a("density", skin.density);
    a("damping", skin.damping);
    a("attached", skin.attached ? 1.0 : 0.0);
  }
}

}  // namespace

void write_layout(hid_t group, const scene::SurfaceSpec& surface) {
  write_mechanisms(group, surface);
  if (surface.skin) archive_skin(AttributeWriter(create_group(group, kSkin)), *surface.skin);
  if (!surface.actuator_of_cell.empty()) write_grid(group, kCell, surface, 1, surface.actuator_of_cell);
  if (!surface.base_heights.empty()) write_grid(group, kBase, surface, 1, surface.base_heights);
  if (surface.cell_poses.empty()) return;
  std::vector<double> place;
  for (const scene::CellPose& p : surface.cell_poses) place.insert(place.end(), {p.x, p.y, p.angle});
  write_grid(group, kPlace, surface, 3, place);
}

void read_layout(hid_t group, scene::SurfaceSpec& surface) {
  if (has_link(group, kMechanisms)) read_mechanisms(group, surface);
  if (has_link(group, kCell)) read_cell_mechanisms(group, surface);
  if (has_link(group, kBase)) surface.base_heights = read_grid<float>(group, kBase, surface, 1);
  if (has_link(group, kPlace)) read_cell_poses(group, surface);
  if (has_link(group, kSkin)) archive_skin(AttributeReader(open_group(group, kSkin)), surface.skin.emplace());
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
