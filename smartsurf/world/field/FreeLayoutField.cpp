#include "smartsurf/world/field/FreeLayoutField.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <tuple>
#include <utility>

#include "smartsurf/world/field/ConvexOnField.h"
#include "smartsurf/world/narrowphase/SupportFeature.h"

namespace smartsurf::world {
namespace {

constexpr int kSides = 4;  // west, east, north, south
constexpr float kInfinite = std::numeric_limits<float>::infinity();
// Lengths along a side that do not count, in pitches.
constexpr float kNegligible = 1e-3F;

Vec3 rotated(const Vec3& v, float sine, float cosine) {
  return {cosine * v.x() - sine * v.y(), sine * v.x() + cosine * v.y(), v.z()};
}

// A corner of a top as seen from a side: along it from its middle, and out from it.
struct SidePoint {
  float along, out;
};
using TopFromSide = std::array<SidePoint, 4>;

SidePoint seen_from(int side, const Vec3& p, const surface::Field& f) {
  switch (side) {
    case 0:
      return {p.y(), -p.x() - f.half_top_x};
    case 1:
      return {p.y(), p.x() - f.half_top_x};
    case 2:
      return {p.x(), p.y() - f.half_top_y};
    default:
      return {p.x(), -p.y() - f.half_top_y};
  }
}

// Calls each(from, to) for the edges of a top.
template <class Each>
void for_each_edge(const TopFromSide& top, Each each) {
  for (std::size_t i = 0; i < top.size(); ++i) each(top[i], top[(i + 1) % top.size()]);
}

// Distance from a side to a top; infinite if it is not across there, or farther than `limit`.
float distance_at(const TopFromSide& top, float along, float negligible, float limit) {
  float nearest = kInfinite, farthest = -kInfinite;
  for_each_edge(top, [&](const SidePoint& a, const SidePoint& b) {
    if ((a.along > along) == (b.along > along)) return;
    const float out = a.out + (along - a.along) / (b.along - a.along) * (b.out - a.out);
    nearest = std::min(nearest, out), farthest = std::max(farthest, out);
  });
  return farthest > negligible && nearest <= limit ? std::max(nearest, 0.0F) : kInfinite;
}

}  // namespace

// The frame of a cell.
struct FreeLayoutField::CellFrame {
  CellFrame(const surface::Field& field, std::size_t cell) : centre_(field.x[cell], field.y[cell], 0) {
    const float angle = field.angle.empty() ? 0.0F : field.angle[cell];
    sine_ = std::sin(angle), cosine_ = std::cos(angle);
  }

  Vec3 vector_to_cell(const Vec3& v) const { return rotated(v, -sine_, cosine_); }
  Vec3 point_to_cell(const Vec3& p) const { return vector_to_cell(p - centre_); }
  Vec3 point_to_table(const Vec3& p) const { return rotated(p, sine_, cosine_) + centre_; }
  // Turns a contact of a body at `centre`, table frame, to the table.
  void turn_to_table(const surface::Field& field, const Vec3& centre, Contact& c) const {
    c.normal = rotated(c.normal, sine_, cosine_);
    c.anchor = rotated(c.anchor, sine_, cosine_);
    set_surface_velocity(field, centre + c.anchor - c.separation * c.normal, c);
  }

 private:
  Vec3 centre_;
  float sine_, cosine_;
};

FreeLayoutField::FreeLayoutField(const surface::Field& field)
    : field_(field),
      cell_reach_(
          length_of(field.half_top_x + max_bridged_gap(field), field.half_top_y + max_bridged_gap(field))) {
  const auto [west, east] = std::minmax_element(field.x.begin(), field.x.end());
  const auto [south, north] = std::minmax_element(field.y.begin(), field.y.end());
  origin_[0] = *west, origin_[1] = *south;
  bucket_size_ = std::max(field.pitch, 2.0F * cell_reach_);
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
  stretch_begin_.push_back(0);
  for (std::size_t i = 0; i < field.x.size(); ++i)
    for (int side = 0; side < kSides; ++side) {
      add_stretches(i, side);
      stretch_begin_.push_back(static_cast<std::int32_t>(stretches_.size()));
    }
}

int FreeLayoutField::bucket(float u, int axis) const {
  const float b = (u - origin_[axis]) / bucket_size_;
  return b <= 0.0F                                      ? 0
         : b >= static_cast<float>(bucket_count_[axis]) ? bucket_count_[axis] - 1
                                                        : static_cast<int>(b);
}

template <class Each>
void FreeLayoutField::for_each_cell(const Vec3& low, const Vec3& high, Each each) const {
  const float west = low.x() - cell_reach_, east = high.x() + cell_reach_, south = low.y() - cell_reach_,
              north = high.y() + cell_reach_;
  const int x1 = bucket(east, 0), y1 = bucket(north, 1);
  for (int y = bucket(south, 1); y <= y1; ++y)
    for (int x = bucket(west, 0); x <= x1; ++x) {
      const std::size_t b = y * bucket_count_[0] + x;
      for (int k = bucket_begin_[b]; k < bucket_begin_[b + 1]; ++k) {
        const std::size_t i = bucket_cells_[k];
        if (field_.x[i] >= west && field_.x[i] <= east && field_.y[i] >= south && field_.y[i] <= north)
          each(i);
      }
    }
}

void FreeLayoutField::find_cells(const Vec3& low, const Vec3& high, std::vector<std::int32_t>& out) const {
  out.clear();
  for_each_cell(low, high, [&](std::size_t i) { out.push_back(static_cast<std::int32_t>(i)); });
  std::sort(out.begin(), out.end());
}

// True if no top, with half a narrow gap around it, reaches up to the point.
bool FreeLayoutField::is_free(const Vec3& point) const {
  bool free = true;
  const float around = 0.5F * max_bridged_gap(field_);
  for_each_cell(point, point, [&](std::size_t i) {
    if (field_.column_height()[i] < point.z()) return;
    const Vec3 p = CellFrame(field_, i).point_to_cell(point);
    free &= std::abs(p.x()) > field_.half_top_x + around || std::abs(p.y()) > field_.half_top_y + around;
  });
  return free;
}

// Appends what is across a side, and a pitch beyond its ends.
void FreeLayoutField::add_stretches(std::size_t cell, int side) {
  const float limit = max_bridged_gap(field_), negligible = kNegligible * field_.pitch,
              reach = (side < 2 ? field_.half_top_y : field_.half_top_x) + field_.pitch;
  const float x = field_.half_top_x, y = field_.half_top_y;
  const CellFrame frame(field_, cell);
  const auto is_beyond = [&](const TopFromSide& top, auto beyond) {
    return std::ranges::all_of(top, beyond);
  };
  std::vector<std::pair<TopFromSide, std::int32_t>> tops;
  std::vector<float> ends{-reach, reach};
  const auto add_end = [&](float along) {
    if (std::abs(along) < reach) ends.push_back(along);
  };
  const Vec3 centre(field_.x[cell], field_.y[cell], 0),
      around = Vec3::Constant(length_of(x, y) + field_.pitch);
  for_each_cell(centre - around, centre + around, [&](std::size_t i) {
    if (i == cell || field_.height[i] == surface::kNoCellHeight) return;
    const CellFrame of_top(field_, i);
    TopFromSide top;
    const Vec3 corner[4] = {{-x, -y, 0}, {x, -y, 0}, {x, y, 0}, {-x, y, 0}};
    for (std::size_t k = 0; k < top.size(); ++k)
      top[k] = seen_from(side, frame.point_to_cell(of_top.point_to_table(corner[k])), field_);
    if (is_beyond(top, [&](const SidePoint& p) { return p.out <= negligible; }) ||
        is_beyond(top, [&](const SidePoint& p) { return p.out > limit; }) ||
        is_beyond(top, [&](const SidePoint& p) { return p.along <= -reach; }) ||
        is_beyond(top, [&](const SidePoint& p) { return p.along >= reach; }))
      return;
    tops.emplace_back(top, static_cast<std::int32_t>(i));
    for_each_edge(top, [&](const SidePoint& a, const SidePoint& b) {
      add_end(a.along);
      for (const float out : {negligible, limit})
        if ((a.out > out) != (b.out > out))
          add_end(a.along + (out - a.out) / (b.out - a.out) * (b.along - a.along));
    });
  });
  std::ranges::sort(ends);
  const std::size_t first = stretches_.size();
  const float shortest = 0.1F * negligible;
  for (std::size_t k = 0; k + 1 < ends.size(); ++k) {
    const float begin = ends[k], end = ends[k + 1], inset = 1e-3F * (end - begin);
    if (!(end - begin > shortest)) continue;
    Stretch s{begin, end, kInfinite, kInfinite, 0.0F, -1};
    for (const auto& [top, i] : tops) {
      // Tops do not overlap: the nearest one is so everywhere between two ends.
      const float at_begin = distance_at(top, begin + inset, negligible, limit),
                  at_end = distance_at(top, end - inset, negligible, limit);
      if (at_begin + at_end < s.gap_begin + s.gap_end) s.gap_begin = at_begin, s.gap_end = at_end, s.cell = i;
    }
    if (s.cell < 0 && stretches_.size() > first && stretches_.back().cell < 0)
      stretches_.back().end = end;
    else
      stretches_.push_back(s);
  }
  for (std::size_t k = first; k < stretches_.size(); ++k) {
    Stretch& s = stretches_[k];
    if (s.cell >= 0) continue;
    if (k == first || k + 1 == stretches_.size()) {
      s.open_width = kInfinite;
    } else {
      s.open_width = s.end - s.begin;
      s.gap_begin = stretches_[k - 1].gap_end, s.gap_end = stretches_[k + 1].gap_begin;
    }
  }
}

bool FreeLayoutField::is_level(std::size_t cell, const Stretch& s) const {
  return std::abs(field_.column_height()[s.cell] - field_.column_height()[cell]) <= kLevelTolerance;
}

FreeCell FreeLayoutField::gaps_around(std::size_t cell, const Vec3& low, const Vec3& high) const {
  FreeCell around{static_cast<std::int32_t>(cell), {}, {}};
  const float least = kNegligible * field_.pitch;
  for (std::size_t side = 0; side < kSides; ++side) {
    const int axis = side < 2 ? 1 : 0;
    const float half = axis == 1 ? field_.half_top_y : field_.half_top_x,
                begin = std::clamp(low[axis] - least, -half, half - least),
                end = std::clamp(high[axis] + least, least - half, half);
    const int first = stretch_begin_[kSides * cell + side], last = stretch_begin_[kSides * cell + side + 1];
    float gap = 0.0F, entered = -1.0F;
    // Where the gap meets another one, the hole has the diagonal of both.
    const auto widen = [&](int k) {
      if (k < first || k >= last || stretches_[k].cell >= 0) return;
      const float width = stretches_[k].end - stretches_[k].begin;
      entered = std::max(entered, std::sqrt(0.5F * (gap * gap + width * width)));
    };
    for (int k = first; k < last; ++k) {
      const Stretch& s = stretches_[k];
      if (s.begin > end - 0.5F * least) break;
      if (s.end < begin + 0.5F * least) continue;
      if (s.cell >= 0 ? !is_level(cell, s)
                      : !(std::isfinite(s.open_width) && is_level(cell, stretches_[k - 1]) &&
                          is_level(cell, stretches_[k + 1]))) {
        entered = kInfinite;
        break;
      }
      const float rate = (s.gap_end - s.gap_begin) / (s.end - s.begin);
      for (const float along : {std::max(begin, s.begin), std::min(end, s.end)})
        gap = std::max(gap, s.gap_begin + (along - s.begin) * rate);
      entered = std::max({entered, gap, s.open_width});
      if (low[axis] <= s.begin && s.begin >= -half - least) widen(k - 1);
      if (high[axis] >= s.end && s.end <= half + least) widen(k + 1);
    }
    around.gap[side] = gap;
    around.entered[side] = entered < 0.0F ? kInfinite : entered;
  }
  return around;
}

Column FreeLayoutField::column(std::size_t cell, const Vec3& low, const Vec3& high, float gap_entered) const {
  FreeCell around = gaps_around(cell, low, high);
  for (float& gap : around.gap) gap *= 0.5F;
  return Columns(field_, gap_entered, &around).at(0, 0);
}

template <class Each>
void FreeLayoutField::for_each_column(const Vec3& low, const Vec3& high, Each each) const {
  if (low.z() > field_.max_height) return;
  for_each_cell(low, high, [&](std::size_t cell) {
    if (field_.column_height()[cell] >= low.z()) each(cell, CellFrame(field_, cell));
  });
}

void FreeLayoutField::collide_sphere(const Vec3& centre, float radius, float margin,
                                     const SphereMotion& motion, std::vector<Contact>& out) const {
  struct Found {
    SphereContact contact;
    float distance;  // horizontal, from the top
    bool is_on_plane() const { return contact.normal.z() == 1.0F; }
  };
  thread_local std::vector<Found> all;
  all.clear();
  const Vec3 extent = Vec3::Constant(radius + margin);
  for_each_column(centre - extent, centre + extent, [&](std::size_t cell, const CellFrame& frame) {
    const SphereMotion local_motion{frame.vector_to_cell(motion.velocity), motion.dt_s};
    const Vec3 local = frame.point_to_cell(centre);
    auto found = collide_sphere_with_cell(field_, gaps_around(cell, local, local), local, radius, margin,
                                          local_motion);
    if (!found) return;
    frame.turn_to_table(field_, centre, *found);
    all.push_back({*found, length_of(std::max(0.0F, std::abs(local.x()) - field_.half_top_x),
                                     std::max(0.0F, std::abs(local.y()) - field_.half_top_y))});
  });
  // Over a bridged gap the nearest top bears.
  const auto is_farther = [](const Found& a, const Found& b) {
    return a.is_on_plane() && b.is_on_plane() &&
           std::abs(a.contact.separation - b.contact.separation) <= 2.0F * kLevelTolerance &&
           std::tie(a.distance, a.contact.feature_id) > std::tie(b.distance, b.contact.feature_id);
  };
  SphereContactReducer reducer;
  for (const Found& a : all)
    if (std::ranges::none_of(all, [&](const Found& b) { return is_farther(a, b); })) reducer.add(a.contact);
  reducer.reduce([&](const Contact& c) { out.push_back(c); });
}

void FreeLayoutField::collide(const Shape& shape, const Vec3& centre, const Mat3& axes, float margin,
                              std::vector<Contact>& out) const {
  const Vec3 extent = Vec3(axes.cwiseAbs() * shape.half_extents) + Vec3::Constant(margin);
  thread_local std::vector<Contact> contacts;
  contacts.clear();
  const bool is_centre_free = is_free(centre);
  for_each_column(centre - extent, centre + extent, [&](std::size_t cell, const CellFrame& frame) {
    Mat3 local_axes;
    for (int i = 0; i < 3; ++i) local_axes.col(i) = frame.vector_to_cell(axes.col(i));
    const Vec3 local = frame.point_to_cell(centre), reach = turned_extents(local_axes, shape.half_extents);
    FreeCell around = gaps_around(cell, local - reach, local + reach);
    around.is_centre_free = is_centre_free;
    const std::size_t first = contacts.size();
    collide_shape_with_field(field_, shape, local, local_axes, margin, contacts, &around);
    for (std::size_t k = first; k < contacts.size(); ++k) frame.turn_to_table(field_, centre, contacts[k]);
  });
  if (field_.has_contacts_per_cell())
    out.insert(out.end(), contacts.begin(), contacts.end());
  else
    append_reduced(contacts, out);
}

}  // namespace smartsurf::world
