#include "smartsurf/world/field/FreeLayoutField.h"

#include <algorithm>
#include <cmath>

#include "smartsurf/world/field/ConvexOnField.h"
#include "smartsurf/world/narrowphase/SupportFeature.h"

namespace smartsurf::world {
namespace {

constexpr int kCentre = 1, kCentreCell = 4;      // row and column, and index, in the local 3×3 grid
constexpr int kNeighbourCell[4] = {3, 5, 1, 7};  // west, east, north, south
constexpr float kSideNormal[4][2] = {{-1, 0}, {1, 0}, {0, 1}, {0, -1}};

float angle_of(const surface::Field& field, std::size_t cell) {
  return field.angle.empty() ? 0.0F : field.angle[cell];
}

Vec3 rotated(const Vec3& v, float sine, float cosine) {
  return {cosine * v.x() - sine * v.y(), sine * v.x() + cosine * v.y(), v.z()};
}

}  // namespace

// The frame of a cell, in which it is the centre of the local grid.
struct FreeLayoutField::CellFrame {
  CellFrame(const surface::Field& field, std::size_t cell)
      : cell_(static_cast<std::int32_t>(cell)),
        centre_(field.x[cell], field.y[cell], 0),
        grid_centre_(field.pitch, field.pitch, 0) {
    const float angle = angle_of(field, cell);
    sine_ = std::sin(angle), cosine_ = std::cos(angle);
  }

  Vec3 vector_to_cell(const Vec3& v) const { return rotated(v, -sine_, cosine_); }
  Vec3 point_to_cell(const Vec3& p) const { return vector_to_cell(p - centre_) + grid_centre_; }
  // A contact of the centre cell.
  void turn_to_table(Contact& c) const {
    for (Vec3* v : {&c.normal, &c.anchor, &c.surface_velocity}) *v = rotated(*v, sine_, cosine_);
    c.feature_id = cell_;
  }

 private:
  std::int32_t cell_;
  Vec3 centre_, grid_centre_;
  float sine_, cosine_;
};

FreeLayoutField::FreeLayoutField(const surface::Field& field)
    : field_(field), half_diagonal_(length_of(field.half_top_x, field.half_top_y)) {
  const auto [west, east] = std::minmax_element(field.x.begin(), field.x.end());
  const auto [south, north] = std::minmax_element(field.y.begin(), field.y.end());
  origin_[0] = *west, origin_[1] = *south;
  bucket_size_ = std::max(field.pitch, 2.0F * half_diagonal_);
  bucket_count_[0] = static_cast<int>((*east - *west) / bucket_size_) + 1;
  bucket_count_[1] = static_cast<int>((*north - *south) / bucket_size_) + 1;
  bucket_begin_.assign(bucket_count_[0] * bucket_count_[1] + 1, 0);
  auto bucket_of = [&](std::size_t i) {
    return bucket(field.y[i], 1) * bucket_count_[0] + bucket(field.x[i], 0);
  };
  for (std::size_t i = 0; i < field.x.size(); ++i) ++bucket_begin_[bucket_of(i) + 1];
  for (std::size_t b = 1; b < bucket_begin_.size(); ++b) bucket_begin_[b] += bucket_begin_[b - 1];
  bucket_cells_.resize(field.x.size());
  std::vector<std::int32_t> next(bucket_begin_);
  for (std::size_t i = 0; i < field.x.size(); ++i)
    bucket_cells_[next[bucket_of(i)]++] = static_cast<std::int32_t>(i);
  for (std::size_t i = 0; i < field.x.size(); ++i) neighbours_.push_back(find_neighbours(i));
}

int FreeLayoutField::bucket(float u, int axis) const {
  const float b = (u - origin_[axis]) / bucket_size_;
  return b <= 0.0F                                      ? 0
         : b >= static_cast<float>(bucket_count_[axis]) ? bucket_count_[axis] - 1
                                                        : static_cast<int>(b);
}

template <class Each>
void FreeLayoutField::for_each_cell(const Vec3& low, const Vec3& high, Each each) const {
  const int x1 = bucket(high.x() + half_diagonal_, 0), y1 = bucket(high.y() + half_diagonal_, 1);
  for (int y = bucket(low.y() - half_diagonal_, 1); y <= y1; ++y)
    for (int x = bucket(low.x() - half_diagonal_, 0); x <= x1; ++x) {
      const std::size_t b = y * bucket_count_[0] + x;
      for (int k = bucket_begin_[b]; k < bucket_begin_[b + 1]; ++k) each(bucket_cells_[k]);
    }
}

void FreeLayoutField::find_cells(const Vec3& low, const Vec3& high, std::vector<std::int32_t>& out) const {
  out.clear();
  for_each_cell(low, high, [&](std::size_t i) { out.push_back(static_cast<std::int32_t>(i)); });
  std::sort(out.begin(), out.end());
}

// Index of the cell whose top, extended by `tolerance` on all sides, contains the point, or −1.
int FreeLayoutField::cell_at(float x, float y, float tolerance) const {
  int found = -1;
  const Vec3 at(x, y, 0), reach(tolerance, tolerance, 0);
  for_each_cell(at - reach, at + reach, [&](std::size_t i) {
    const float angle = angle_of(field_, i);
    const Vec3 p = rotated(at - Vec3(field_.x[i], field_.y[i], 0), -std::sin(angle), std::cos(angle));
    if (found < 0 && std::abs(p.x()) <= field_.half_top_x + tolerance &&
        std::abs(p.y()) <= field_.half_top_y + tolerance)
      found = static_cast<int>(i);
  });
  return found;
}

// Samples across each side at three quarters of the gap, where the neighbour is closer than the cell itself.
FreeLayoutField::Neighbours FreeLayoutField::find_neighbours(std::size_t cell) const {
  Neighbours n;
  const float angle = angle_of(field_, cell);
  for (int side = 0; side < 4; ++side) {
    const bool along_x = side < 2;
    const float half = along_x ? field_.half_top_x : field_.half_top_y;
    const float gap = std::max(field_.pitch - 2.0F * half, 0.0F);
    for (int k = 0; k < 2; ++k) {
      const float lateral = (k ? 0.5F : -0.5F) * (along_x ? field_.half_top_y : field_.half_top_x);
      const float distance = half + 0.75F * gap + 1e-3F;
      const Vec3 local = along_x ? Vec3(kSideNormal[side][0] * distance, lateral, 0)
                                 : Vec3(lateral, kSideNormal[side][1] * distance, 0);
      const Vec3 at =
          Vec3(field_.x[cell], field_.y[cell], 0) + rotated(local, std::sin(angle), std::cos(angle));
      n.cell[side][k] = cell_at(at.x(), at.y(), 0.5F * gap);
      if (n.cell[side][k] == static_cast<int>(cell)) n.cell[side][k] = -1;
    }
  }
  return n;
}

bool FreeLayoutField::is_bridged(std::size_t cell, int side) const {
  for (const std::int32_t n : neighbours_[cell].cell[side])
    if (n < 0 || !(std::abs(field_.column_height()[n] - field_.column_height()[cell]) <= kLevelTolerance))
      return false;
  return true;
}

surface::Field FreeLayoutField::make_local_grid() const {
  surface::Field f;
  f.rows = f.columns = 3;
  f.pitch = field_.pitch;
  f.half_top_x = field_.half_top_x;
  f.half_top_y = field_.half_top_y;
  f.height.assign(9, surface::kNoCellHeight);
  f.speed.assign(9, 0.0F);
  if (field_.has_surface_velocity()) f.surface_velocity_x = f.surface_velocity_y = f.surface_spin = f.speed;
  if (field_.has_contacts_per_cell())
    f.force_limit = f.speed;  // the values are unused; a non-empty array selects manifolds per cell
  return f;
}

void FreeLayoutField::load_local_grid(std::size_t cell, surface::Field& f) const {
  f.max_height = f.height[kCentreCell] = field_.column_height()[cell];
  f.speed[kCentreCell] = field_.speed[cell];
  for (int side = 0; side < 4; ++side)
    f.height[kNeighbourCell[side]] =
        is_bridged(cell, side) ? field_.column_height()[cell] : surface::kNoCellHeight;
  // A corner between two level neighbours counts as filled.
  for (const int corner : {0, 2, 6, 8}) {
    const std::size_t row = corner < 3 ? 1 : 7, column = corner % 3 == 0 ? 3 : 5;
    f.height[corner] = std::min(f.height[row], f.height[column]);
  }
  if (!field_.has_surface_velocity()) return;
  const float angle = angle_of(field_, cell);
  const Vec3 local_velocity = rotated({field_.surface_velocity_x[cell], field_.surface_velocity_y[cell], 0},
                                      -std::sin(angle), std::cos(angle));
  f.surface_velocity_x[kCentreCell] = local_velocity.x();
  f.surface_velocity_y[kCentreCell] = local_velocity.y();
  f.surface_spin[kCentreCell] = field_.surface_spin.empty() ? 0.0F : field_.surface_spin[cell];
}

template <class Each>
void FreeLayoutField::for_each_local_grid(const Vec3& low, const Vec3& high, Each each) const {
  if (low.z() > field_.max_height) return;
  surface::Field local_grid = make_local_grid();
  for_each_cell(low, high, [&](std::size_t cell) {
    if (field_.column_height()[cell] < low.z()) return;
    load_local_grid(cell, local_grid);
    each(local_grid, CellFrame(field_, cell));
  });
}

void FreeLayoutField::collide_sphere(const Vec3& centre, float radius, float margin,
                                     const SphereMotion& motion, std::vector<Contact>& out) const {
  const Vec3 extent = Vec3::Constant(radius + margin);
  SphereContactReducer reducer;
  for_each_local_grid(
      centre - extent, centre + extent, [&](const surface::Field& local_grid, const CellFrame& frame) {
        const SphereMotion local_motion{frame.vector_to_cell(motion.velocity), motion.dt_s};
        auto found = collide_sphere_with_cell(local_grid, kCentre, kCentre, frame.point_to_cell(centre),
                                              radius, margin, local_motion);
        if (!found) return;
        frame.turn_to_table(*found);
        reducer.add(*found);
      });
  reducer.reduce([&](const Contact& c) { out.push_back(c); });
}

void FreeLayoutField::collide(const Shape& shape, const Vec3& centre, const Mat3& axes, float margin,
                              std::vector<Contact>& out) const {
  const Vec3 extent = Vec3(axes.cwiseAbs() * shape.half_extents) + Vec3::Constant(margin);
  std::vector<Contact> contacts, of_grid;
  for_each_local_grid(
      centre - extent, centre + extent, [&](const surface::Field& local_grid, const CellFrame& frame) {
        Mat3 local_axes;
        for (int i = 0; i < 3; ++i) local_axes.col(i) = frame.vector_to_cell(axes.col(i));
        of_grid.clear();
        collide_shape_with_field(local_grid, shape, frame.point_to_cell(centre), local_axes, margin, of_grid);
        for (Contact& c : of_grid) {
          if (c.feature_id != kCentreCell) continue;
          frame.turn_to_table(c);
          contacts.push_back(c);
        }
      });
  if (field_.has_contacts_per_cell())
    out.insert(out.end(), contacts.begin(), contacts.end());
  else
    append_reduced(contacts, out);
}

}  // namespace smartsurf::world
