#include "smartsurf/record/hdf5/CatalogueWriter.h"

#include <cassert>
#include <cstdint>
#include <limits>

#include "smartsurf/record/hdf5/Names.h"

namespace smartsurf::record {
namespace {

namespace column = paths::column;

struct ShapeName {
  scene::ShapeKind shape;
  const char* name;
};
constexpr ShapeName kShapeNames[] = {
    {scene::ShapeKind::kSphere, "sphere"},     {scene::ShapeKind::kBox, "box"},
    {scene::ShapeKind::kCylinder, "cylinder"}, {scene::ShapeKind::kCapsule, "capsule"},
    {scene::ShapeKind::kCone, "cone"},         {scene::ShapeKind::kSolid, "solid"}};
static_assert(std::size(kShapeNames) == scene::kShapeKindCount);

constexpr hsize_t kChunkObjects = 64;

Handle copy_type(hid_t type) { return Handle(H5Tcopy(type), H5Tclose, "type"); }

// Concatenates value(object) of all objects; each value is a range of numbers.
template <class Number, class Value>
std::vector<Number> gather_values(std::span<const scene::ObjectSpec> objects, Value value) {
  std::vector<Number> numbers;
  for (const scene::ObjectSpec& object : objects)
    for (const auto number : value(object)) numbers.push_back(static_cast<Number>(number));
  return numbers;
}

template <class Value>
std::vector<const char*> gather_strings(std::span<const scene::ObjectSpec> objects, Value value) {
  std::vector<const char*> characters;
  for (const scene::ObjectSpec& object : objects) characters.push_back(value(object));
  return characters;
}

double radius_or_nan(const scene::ObjectSpec& object) {
  const bool has_radius = object.shape != scene::ShapeKind::kBox && object.shape != scene::ShapeKind::kSolid;
  return has_radius ? object.radius : std::numeric_limits<double>::quiet_NaN();
}

double height_or_nan(const scene::ObjectSpec& object) {
  const bool has_height = object.shape == scene::ShapeKind::kCylinder ||
                          object.shape == scene::ShapeKind::kCapsule ||
                          object.shape == scene::ShapeKind::kCone;
  return has_height ? object.height : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace

const char* shape_name(scene::ShapeKind shape) {
  for (const ShapeName& entry : kShapeNames)
    if (entry.shape == shape) return entry.name;
  assert(false);
  return "";
}

bool parse_shape(const std::string& name, scene::ShapeKind& shape) {
  for (const ShapeName& entry : kShapeNames)
    if (entry.name == name) {
      shape = entry.shape;
      return true;
    }
  return false;
}

CatalogueWriter::CatalogueWriter(hid_t file, hid_t group, std::vector<scene::Material> materials)
    : materials_(std::move(materials)), solids_(file) {
  add_column(group, column::kId, copy_type(H5T_NATIVE_UINT32), 1);
  add_column(group, column::kLabel, string_type(), 1);
  add_column(group, column::kShape, string_type(), 1);
  add_column(group, column::kMaterial, string_type(), 1);
  add_column(group, column::kRadius, copy_type(H5T_NATIVE_DOUBLE), 1);
  add_column(group, column::kHeight, copy_type(H5T_NATIVE_DOUBLE), 1);
  add_column(group, column::kSolid, copy_type(H5T_NATIVE_INT32), 1);
  add_column(group, column::kExtents, copy_type(H5T_NATIVE_DOUBLE), 3);
  add_column(group, column::kMass, copy_type(H5T_NATIVE_DOUBLE), 1);
  add_column(group, column::kCentreOfMass, copy_type(H5T_NATIVE_DOUBLE), 3);
  add_column(group, column::kFixed, copy_type(H5T_NATIVE_UINT8), 1);
  add_column(group, column::kColour, copy_type(H5T_NATIVE_FLOAT), 3);
  add_column(group, column::kInitialPosition, copy_type(H5T_NATIVE_DOUBLE), 3);
  add_column(group, column::kInitialOrientation, copy_type(H5T_NATIVE_DOUBLE), 4);
  add_column(group, column::kInitialVelocity, copy_type(H5T_NATIVE_DOUBLE), 3);
  add_column(group, column::kInitialAngularVelocity, copy_type(H5T_NATIVE_DOUBLE), 3);
}

void CatalogueWriter::add_column(hid_t group, const char* name, Handle type, int width) {
  const int rank = width == 1 ? 1 : 2;
  const std::vector<hsize_t> initial_size{0, static_cast<hsize_t>(width)};
  const std::vector<hsize_t> max_size{H5S_UNLIMITED, static_cast<hsize_t>(width)};
  const Handle space(H5Screate_simple(rank, initial_size.data(), max_size.data()), H5Sclose, name);
  std::vector<hsize_t> chunk{kChunkObjects};
  if (rank == 2) chunk.push_back(static_cast<hsize_t>(width));
  Handle dataset = create_dataset(group, name, type, space, chunked_properties(chunk));
  columns_.push_back({name, width, std::move(type), std::move(dataset)});
}

void CatalogueWriter::write_column(const char* name, const void* values, hsize_t count) {
  for (const Column& column : columns_) {
    if (column.name != name) continue;
    const int rank = column.width == 1 ? 1 : 2;
    const hsize_t width = static_cast<hsize_t>(column.width);
    const hsize_t extent[] = {rows_written_ + count, width}, start[] = {rows_written_, 0},
                  size[] = {count, width};
    check(H5Dset_extent(column.dataset, extent), name);
    const Handle file(H5Dget_space(column.dataset), H5Sclose, name);
    check(H5Sselect_hyperslab(file, H5S_SELECT_SET, start, nullptr, size, nullptr), name);
    const Handle memory(H5Screate_simple(rank, size, nullptr), H5Sclose, name);
    check(H5Dwrite(column.dataset, column.type, memory, file, H5P_DEFAULT, values), name);
    return;
  }
  assert(false);
}

std::uint64_t CatalogueWriter::max_bytes(std::span<const scene::ObjectSpec> objects) const {
  if (objects.empty()) return 0;
  constexpr std::uint64_t kBytesPerObject = 544, kBytesPerChunk = kChunkObjects * kBytesPerObject;
  std::uint64_t bytes = kBytesPerChunk + kBytesPerObject * objects.size();
  for (const scene::ObjectSpec& object : objects) bytes += 2 * object.label.size();
  return bytes + solids_.max_bytes(objects);
}

void CatalogueWriter::append(std::span<const scene::ObjectSpec> objects) {
  using Spec = scene::ObjectSpec;
  const hsize_t count = objects.size();
  if (count == 0) return;
  solids_.add(objects);
  const auto scalar = [](double v) { return std::vector<double>{v}; };
  const auto vector = [](const Eigen::Vector3d& v) { return std::vector<double>{v.x(), v.y(), v.z()}; };
  const auto material = [&](const Spec& o) -> const scene::Material& { return materials_.at(o.material); };
  const auto mass = [&](const Spec& o) { return o.mass.value_or(material(o).density * o.volume()); };

  std::vector<std::uint32_t> ids(objects.size());
  for (std::size_t i = 0; i < ids.size(); ++i) ids[i] = static_cast<std::uint32_t>(rows_written_ + i);
  write_column(column::kId, ids.data(), count);
  write_column(column::kLabel, gather_strings(objects, [](const Spec& o) { return o.label.c_str(); }).data(),
               count);
  write_column(column::kShape,
               gather_strings(objects, [](const Spec& o) { return shape_name(o.shape); }).data(), count);
  write_column(column::kMaterial,
               gather_strings(objects, [&](const Spec& o) { return material(o).name.c_str(); }).data(),
               count);

  const auto numbers = [&](const char* name, auto value) {
    write_column(name, gather_values<double>(objects, value).data(), count);
  };
  numbers(column::kRadius, [&](const Spec& o) { return scalar(radius_or_nan(o)); });
  numbers(column::kHeight, [&](const Spec& o) { return scalar(height_or_nan(o)); });
  const auto solid = [&](const Spec& o) { return std::vector{solids_.solid_index(o.solid)}; };
  write_column(column::kSolid, gather_values<std::int32_t>(objects, solid).data(), count);
  numbers(column::kExtents, [&](const Spec& o) { return vector(2.0 * o.half_extents()); });
  numbers(column::kMass, [&](const Spec& o) { return scalar(mass(o)); });
  numbers(column::kCentreOfMass, [&](const Spec& o) { return vector(o.centre_of_mass); });
  numbers(column::kInitialPosition, [&](const Spec& o) { return vector(o.position); });
  numbers(column::kInitialOrientation, [](const Spec& o) {
    return std::vector<double>{o.orientation.x(), o.orientation.y(), o.orientation.z(), o.orientation.w()};
  });
  numbers(column::kInitialVelocity, [&](const Spec& o) { return vector(o.velocity); });
  numbers(column::kInitialAngularVelocity, [&](const Spec& o) { return vector(o.angular_velocity); });
  write_column(
      column::kFixed,
      gather_values<std::uint8_t>(objects, [&](const Spec& o) { return scalar(o.fixed ? 1.0 : 0.0); }).data(),
      count);
  write_column(column::kColour,
               gather_values<float>(objects,
                                    [](const Spec& o) {
                                      return std::vector<float>{o.colour.r, o.colour.g, o.colour.b};
                                    })
                   .data(),
               count);
  rows_written_ += count;
}

}  // namespace smartsurf::record
