#include "smartsurf/record/Solids.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <string>

namespace smartsurf::record {
namespace {

constexpr const char* kLastWritten = "face_corners";  // with it a solid is whole
constexpr hsize_t kMostNumbers = hsize_t{1} << 28;    // of a dataset; refuse what cannot be meant

// count × width numbers, or count where the width is 1.
template <class Number>
void write_table(hid_t group, const char* name, hid_t type, const std::vector<Number>& numbers,
                 hsize_t width) {
  const hsize_t size[] = {numbers.size() / width, width};
  const Handle space(H5Screate_simple(width == 1 ? 1 : 2, size, nullptr), H5Sclose, name);
  const Handle properties(H5Pcreate(H5P_DATASET_CREATE), H5Pclose, name);
  check(H5Pset_obj_track_times(properties, false), name);
  const Handle dataset = create_dataset(group, name, type, space, properties);
  check(H5Dwrite(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, numbers.data()), name);
}

template <class Number>
std::vector<Number> read_table(hid_t group, const char* name, hid_t type, hsize_t width) {
  const Handle dataset(H5Dopen2(group, name, H5P_DEFAULT), H5Dclose, std::string("has no dataset ") + name);
  const std::vector<hsize_t> size = extents(dataset);
  if (size.size() != (width == 1 ? 1U : 2U) || (width > 1 && size[1] != width))
    throw Hdf5Error(std::string("dataset ") + name + " of a solid has the wrong shape");
  // Never compressed, so that an extent cannot claim more than is there.
  if (size[0] > kMostNumbers / width || H5Dget_storage_size(dataset) < size[0] * width)
    throw Hdf5Error(std::string("dataset ") + name + " of a solid is not all there");
  std::vector<Number> numbers(size[0] * width);
  if (!numbers.empty())
    check(H5Dread(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, numbers.data()),
          std::string("dataset ") + name);
  return numbers;
}

std::vector<float> flat(const std::vector<Eigen::Vector3f>& points) {
  std::vector<float> numbers;
  for (const auto& p : points) numbers.insert(numbers.end(), p.data(), p.data() + 3);
  return numbers;
}

std::vector<Eigen::Vector3f> points_of(const std::vector<float>& numbers) {
  std::vector<Eigen::Vector3f> points;
  for (std::size_t i = 0; i + 2 < numbers.size(); i += 3) {
    points.emplace_back(numbers[i], numbers[i + 1], numbers[i + 2]);
    if (!points.back().allFinite()) throw Hdf5Error("a solid has a point that is not finite");
  }
  return points;
}

// The convex pieces as plain columns.
struct Columns {
  std::vector<float> corners;
  std::vector<std::uint32_t> corner_count, face_count;  // of each piece
  std::vector<std::uint32_t> face_size;                 // of each face
  std::vector<std::uint16_t> face_corners;              // numbers of the piece's own corners
};

Columns columns_of(const scene::Solid& solid) {
  Columns all;
  for (const scene::ConvexPiece& piece : solid.pieces) {
    const std::vector<float> corners = flat(piece.corners);
    all.corners.insert(all.corners.end(), corners.begin(), corners.end());
    all.corner_count.push_back(static_cast<std::uint32_t>(piece.corners.size()));
    all.face_count.push_back(static_cast<std::uint32_t>(piece.faces.size()));
    for (const auto& face : piece.faces) {
      all.face_size.push_back(face.count);
      for (std::uint32_t i = 0; i < face.count; ++i)
        all.face_corners.push_back(piece.face_corners[face.first + i]);
    }
  }
  return all;
}

// Hands out the columns' entries one run after the other, and none that are not there.
template <class Number>
class Runs {
 public:
  explicit Runs(const std::vector<Number>& numbers) : left_(numbers) {}
  std::span<const Number> next(std::size_t count) {
    if (count > left_.size()) throw Hdf5Error("the pieces of a solid are not all there");
    const auto run = left_.first(count);
    left_ = left_.subspan(count);
    return run;
  }

 private:
  std::span<const Number> left_;
};

std::vector<scene::ConvexPiece> pieces_of(const Columns& columns) {
  const std::vector<Eigen::Vector3f> all_corners = points_of(columns.corners);
  Runs<Eigen::Vector3f> corners(all_corners);
  Runs<std::uint32_t> sizes(columns.face_size);
  Runs<std::uint16_t> loops(columns.face_corners);
  if (columns.corner_count.empty() || columns.corner_count.size() != columns.face_count.size())
    throw Hdf5Error("a solid has no pieces");
  std::vector<scene::ConvexPiece> pieces;
  for (std::size_t i = 0; i < columns.corner_count.size(); ++i) {
    const auto own = corners.next(columns.corner_count[i]);
    const auto faces = sizes.next(columns.face_count[i]);
    std::size_t length = 0;
    for (const std::uint32_t size : faces) length += size;
    const auto loop = loops.next(length);
    const bool small =
        own.size() < 4 || faces.size() < 4 || *std::min_element(faces.begin(), faces.end()) < 3;
    if (small || *std::max_element(loop.begin(), loop.end()) >= own.size())
      throw Hdf5Error("a piece of a solid is no polyhedron");
    pieces.push_back(scene::make_piece({own.begin(), own.end()}, {loop.begin(), loop.end()}, faces));
  }
  return pieces;
}

void write_solid(hid_t group, const scene::Solid& solid) {
  write_attribute(group, "source", solid.source);
  write_attribute(group, "volume", solid.volume);
  write_attribute(group, "inertia", H5T_NATIVE_DOUBLE, solid.inertia.data(), 9);
  std::vector<std::uint32_t> triangles;
  for (const auto& t : solid.triangles) triangles.insert(triangles.end(), t.begin(), t.end());
  const Columns columns = columns_of(solid);
  write_table(group, "vertices", H5T_NATIVE_FLOAT, flat(solid.vertices), 3);
  write_table(group, "triangles", H5T_NATIVE_UINT32, triangles, 3);
  write_table(group, "corners", H5T_NATIVE_FLOAT, columns.corners, 3);
  write_table(group, "corner_count", H5T_NATIVE_UINT32, columns.corner_count, 1);
  write_table(group, "face_count", H5T_NATIVE_UINT32, columns.face_count, 1);
  write_table(group, "face_size", H5T_NATIVE_UINT32, columns.face_size, 1);
  write_table(group, kLastWritten, H5T_NATIVE_UINT16, columns.face_corners, 1);
}

scene::Solid read_solid(hid_t group) {
  scene::Solid solid;
  solid.source = read_text_attribute(group, "source");
  read_attribute(group, "volume", H5T_NATIVE_DOUBLE, &solid.volume);
  read_attribute(group, "inertia", H5T_NATIVE_DOUBLE, solid.inertia.data(), 9);
  if (!(solid.volume > 0.0) || !std::isfinite(solid.volume) || !solid.inertia.allFinite())
    throw Hdf5Error("a solid has no volume or inertia");
  solid.vertices = points_of(read_table<float>(group, "vertices", H5T_NATIVE_FLOAT, 3));
  if (solid.vertices.empty()) throw Hdf5Error("a solid has no vertices");
  const auto triangles = read_table<std::uint32_t>(group, "triangles", H5T_NATIVE_UINT32, 3);
  for (std::size_t i = 0; i + 2 < triangles.size(); i += 3) {
    solid.triangles.push_back({triangles[i], triangles[i + 1], triangles[i + 2]});
    if (*std::max_element(solid.triangles.back().begin(), solid.triangles.back().end()) >=
        solid.vertices.size())
      throw Hdf5Error("a triangle of a solid names a vertex that is not there");
  }
  Columns columns;
  columns.corners = read_table<float>(group, "corners", H5T_NATIVE_FLOAT, 3);
  columns.corner_count = read_table<std::uint32_t>(group, "corner_count", H5T_NATIVE_UINT32, 1);
  columns.face_count = read_table<std::uint32_t>(group, "face_count", H5T_NATIVE_UINT32, 1);
  columns.face_size = read_table<std::uint32_t>(group, "face_size", H5T_NATIVE_UINT32, 1);
  columns.face_corners = read_table<std::uint16_t>(group, kLastWritten, H5T_NATIVE_UINT16, 1);
  solid.pieces = pieces_of(columns);
  scene::set_bounds(solid);
  return solid;
}

}  // namespace

SolidWriter::SolidWriter(hid_t file) : group_(create_group(file, "solids")) {}

void SolidWriter::add(std::span<const scene::ObjectSpec> objects) {
  for (const scene::ObjectSpec& object : objects) {
    if (!object.solid) continue;
    const auto [at, is_new] = numbers_.try_emplace(object.solid, static_cast<int>(numbers_.size()));
    if (is_new) write_solid(create_group(group_, std::to_string(at->second).c_str()), *object.solid);
  }
}

int SolidWriter::number_of(const std::shared_ptr<const scene::Solid>& solid) const {
  if (!solid) return -1;
  const auto at = numbers_.find(solid);
  assert(at != numbers_.end());
  return at->second;
}

std::uint64_t SolidWriter::most_bytes(std::span<const scene::ObjectSpec> objects) const {
  constexpr std::uint64_t kBytesASolid = 16384;  // groups, headers, attributes
  std::map<std::shared_ptr<const scene::Solid>, bool> fresh;
  std::uint64_t bytes = 0;
  for (const scene::ObjectSpec& object : objects) {
    if (!object.solid || numbers_.contains(object.solid) || !fresh.try_emplace(object.solid, true).second)
      continue;
    const Columns columns = columns_of(*object.solid);
    bytes += kBytesASolid + 12 * (object.solid->vertices.size() + object.solid->triangles.size()) +
             4 * (columns.corners.size() + columns.corner_count.size() + columns.face_count.size() +
                  columns.face_size.size()) +
             2 * columns.face_corners.size() + 2 * object.solid->source.size();
  }
  return bytes;
}

std::vector<std::shared_ptr<const scene::Solid>> read_solids(hid_t file) {
  std::vector<std::shared_ptr<const scene::Solid>> solids;
  if (H5Lexists(file, "solids", H5P_DEFAULT) <= 0) return solids;
  const Handle all(H5Gopen2(file, "solids", H5P_DEFAULT), H5Gclose, "has no group solids");
  for (std::string name = "0"; H5Lexists(all, name.c_str(), H5P_DEFAULT) > 0;
       name = std::to_string(solids.size())) {
    const Handle group(H5Gopen2(all, name.c_str(), H5P_DEFAULT), H5Gclose, "solids/" + name + " is no group");
    if (H5Lexists(group, kLastWritten, H5P_DEFAULT) <= 0) break;  // a killed run may have got only this far
    solids.push_back(std::make_shared<const scene::Solid>(read_solid(group)));
  }
  return solids;
}

}  // namespace smartsurf::record
