#include "smartsurf/record/hdf5/SolidStorage.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <string>

#include "smartsurf/record/hdf5/AttributeArchive.h"
#include "smartsurf/record/hdf5/Hdf5Reading.h"
#include "smartsurf/record/hdf5/Names.h"

namespace smartsurf::record {
namespace {

constexpr const char* kLastDataset = "face_corners";  // written last: marks a complete solid
constexpr hsize_t kMaxValues = hsize_t{1} << 28;      // per dataset; more is implausible

// Writes a table of count × width numbers, or a column of count if width is 1.
template <class Number>
void write_table(hid_t group, const char* name, const std::vector<Number>& numbers, hsize_t width) {
  const hsize_t size[] = {numbers.size() / width, width};
  write_dataset(group, name, std::span(size).first(width == 1 ? 1 : 2), native_type<Number>(),
                numbers.data());
}

template <class Number>
std::vector<Number> read_table(hid_t group, const char* name, hsize_t width) {
  const Handle dataset = open_dataset(group, name);
  const std::vector<hsize_t> size = extents(dataset);
  if (size.size() != (width == 1 ? 1U : 2U) || (width > 1 && size[1] != width))
    throw Hdf5Error(std::string("dataset ") + name + " of a solid has the wrong shape");
  // These datasets are never compressed, so the stored size bounds the extent.
  if (size[0] > kMaxValues / width || stored_bytes(dataset) < size[0] * width)
    throw Hdf5Error(std::string("dataset ") + name + " of a solid is incomplete");
  std::vector<Number> numbers(size[0] * width);
  if (!numbers.empty())
    check(H5Dread(dataset, native_type<Number>(), H5S_ALL, H5S_ALL, H5P_DEFAULT, numbers.data()),
          std::string("dataset ") + name);
  return numbers;
}

std::vector<float> flatten_points(const std::vector<Eigen::Vector3f>& points) {
  std::vector<float> numbers;
  for (const auto& p : points) numbers.insert(numbers.end(), p.data(), p.data() + 3);
  return numbers;
}

std::vector<Eigen::Vector3f> unflatten_points(const std::vector<float>& numbers) {
  std::vector<Eigen::Vector3f> points;
  for (std::size_t i = 0; i + 2 < numbers.size(); i += 3) {
    points.emplace_back(numbers[i], numbers[i + 1], numbers[i + 2]);
    if (!points.back().allFinite()) throw Hdf5Error("a solid has a point that is not finite");
  }
  return points;
}

// A solid's mesh and convex hulls as columns.
struct SolidColumns {
  std::vector<float> vertices;                          // of the mesh that is drawn
  std::vector<std::uint32_t> triangles;                 // likewise
  std::vector<float> corners;                           // of all hulls
  std::vector<std::uint32_t> corner_count, face_count;  // per hull
  std::vector<std::uint32_t> face_size;                 // per face
  std::vector<std::uint16_t> face_corners;              // indices into the hull's own corners
};

SolidColumns to_columns(const scene::Solid& solid) {
  SolidColumns columns;
  columns.vertices = flatten_points(solid.vertices);
  for (const auto& t : solid.triangles) columns.triangles.insert(columns.triangles.end(), t.begin(), t.end());
  for (const scene::ConvexHull& hull : solid.hulls) {
    const std::vector<float> corners = flatten_points(hull.vertices);
    columns.corners.insert(columns.corners.end(), corners.begin(), corners.end());
    columns.corner_count.push_back(static_cast<std::uint32_t>(hull.vertices.size()));
    columns.face_count.push_back(static_cast<std::uint32_t>(hull.faces.size()));
    for (const auto& face : hull.faces) {
      columns.face_size.push_back(face.vertex_count);
      for (std::uint32_t i = 0; i < face.vertex_count; ++i)
        columns.face_corners.push_back(hull.face_vertices[face.first_vertex + i]);
    }
  }
  return columns;
}

// Splits a column into consecutive spans; throws at its end.
template <class Number>
class SpanReader {
 public:
  explicit SpanReader(const std::vector<Number>& numbers) : remaining_(numbers) {}
  std::span<const Number> take(std::size_t count) {
    if (count > remaining_.size()) throw Hdf5Error("the convex hulls of a solid are incomplete");
    const auto taken = remaining_.first(count);
    remaining_ = remaining_.subspan(count);
    return taken;
  }

 private:
  std::span<const Number> remaining_;
};

std::vector<scene::ConvexHull> to_hulls(const SolidColumns& columns) {
  const std::vector<Eigen::Vector3f> all_corners = unflatten_points(columns.corners);
  SpanReader<Eigen::Vector3f> corner_reader(all_corners);
  SpanReader<std::uint32_t> face_size_reader(columns.face_size);
  SpanReader<std::uint16_t> face_corner_reader(columns.face_corners);
  if (columns.corner_count.empty() || columns.corner_count.size() != columns.face_count.size())
    throw Hdf5Error("a solid has no convex hulls");
  std::vector<scene::ConvexHull> hulls;
  for (std::size_t i = 0; i < columns.corner_count.size(); ++i) {
    const auto hull_corners = corner_reader.take(columns.corner_count[i]);
    const auto face_sizes = face_size_reader.take(columns.face_count[i]);
    std::size_t length = 0;
    for (const std::uint32_t size : face_sizes) length += size;
    const auto face_corners = face_corner_reader.take(length);
    const bool degenerate = hull_corners.size() < 4 || face_sizes.size() < 4 ||
                            *std::min_element(face_sizes.begin(), face_sizes.end()) < 3;
    if (degenerate || *std::max_element(face_corners.begin(), face_corners.end()) >= hull_corners.size())
      throw Hdf5Error("a convex hull of a solid is not a polyhedron");
    hulls.push_back(scene::make_convex_hull({hull_corners.begin(), hull_corners.end()},
                                            {face_corners.begin(), face_corners.end()}, face_sizes));
  }
  return hulls;
}

// Calls table(name, column, width) for each dataset, in the order in which they are written.
template <class Columns, class Table>
void for_each_table(Columns& columns, Table table) {
  table("vertices", columns.vertices, 3);
  table("triangles", columns.triangles, 3);
  table("corners", columns.corners, 3);
  table("corner_count", columns.corner_count, 1);
  table("face_count", columns.face_count, 1);
  table("face_size", columns.face_size, 1);
  table(kLastDataset, columns.face_corners, 1);
}

template <class Archive, class Solid>
void archive_attributes(const Archive& a, Solid& solid) {
  a("source", solid.source);
  a("volume", solid.volume);
  std::array<double, 9> inertia;
  Eigen::Map<Eigen::Matrix3d> matrix(inertia.data());
  matrix = solid.inertia;
  a("inertia", inertia);
  if constexpr (Archive::kReads) solid.inertia = matrix;
}

void write_solid(hid_t group, const scene::Solid& solid) {
  archive_attributes(AttributeWriter(group), solid);
  const SolidColumns columns = to_columns(solid);
  for_each_table(columns, [&](const char* name, const auto& column, hsize_t width) {
    write_table(group, name, column, width);
  });
}

scene::Solid read_solid(hid_t group) {
  scene::Solid solid;
  archive_attributes(AttributeReader(group), solid);
  if (!(solid.volume > 0.0) || !solid.inertia.allFinite())
    throw Hdf5Error("a solid has no volume or inertia");
  SolidColumns columns;
  for_each_table(columns, [&]<class Number>(const char* name, std::vector<Number>& column, hsize_t width) {
    column = read_table<Number>(group, name, width);
  });
  solid.vertices = unflatten_points(columns.vertices);
  if (solid.vertices.empty()) throw Hdf5Error("a solid has no vertices");
  for (std::size_t i = 0; i + 2 < columns.triangles.size(); i += 3) {
    const auto& t = solid.triangles.emplace_back(
        std::array{columns.triangles[i], columns.triangles[i + 1], columns.triangles[i + 2]});
    if (std::ranges::max(t) >= solid.vertices.size())
      throw Hdf5Error("a triangle of a solid has a vertex index out of range");
  }
  solid.hulls = to_hulls(columns);
  scene::compute_bounds(solid);
  return solid;
}

}  // namespace

SolidWriter::SolidWriter(hid_t file) : group_(create_group(file, paths::kSolids)) {}

void SolidWriter::add(std::span<const scene::ObjectSpec> objects) {
  for (const scene::ObjectSpec& object : objects) {
    if (!object.solid) continue;
    const auto [at, is_new] = indices_.try_emplace(object.solid, static_cast<int>(indices_.size()));
    if (is_new) write_solid(create_group(group_, std::to_string(at->second).c_str()), *object.solid);
  }
}

int SolidWriter::solid_index(const std::shared_ptr<const scene::Solid>& solid) const {
  if (!solid) return -1;
  const auto entry = indices_.find(solid);
  assert(entry != indices_.end());
  return entry->second;
}

std::uint64_t SolidWriter::max_bytes(std::span<const scene::ObjectSpec> objects) const {
  constexpr std::uint64_t kBytesPerSolid = 16384;  // groups, headers, attributes
  std::map<std::shared_ptr<const scene::Solid>, bool> new_solids;
  std::uint64_t bytes = 0;
  for (const scene::ObjectSpec& object : objects) {
    if (!object.solid || indices_.contains(object.solid) ||
        !new_solids.try_emplace(object.solid, true).second)
      continue;
    const SolidColumns columns = to_columns(*object.solid);
    bytes += kBytesPerSolid + 12 * (object.solid->vertices.size() + object.solid->triangles.size()) +
             4 * (columns.corners.size() + columns.corner_count.size() + columns.face_count.size() +
                  columns.face_size.size()) +
             2 * columns.face_corners.size() + 2 * object.solid->source.size();
  }
  return bytes;
}

std::vector<std::shared_ptr<const scene::Solid>> read_solids(hid_t file) {
  std::vector<std::shared_ptr<const scene::Solid>> solids;
  if (!has_link(file, paths::kSolids)) return solids;
  const Handle solids_group = open_group(file, paths::kSolids);
  for (std::string name = "0"; has_link(solids_group, name.c_str()); name = std::to_string(solids.size())) {
    const Handle group = open_group(solids_group, name.c_str());
    if (!has_link(group, kLastDataset)) break;  // incomplete: the run was killed
    solids.push_back(std::make_shared<const scene::Solid>(read_solid(group)));
  }
  return solids;
}

}  // namespace smartsurf::record
