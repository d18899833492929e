#include "smartsurf/world/field/SupportPatch.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "smartsurf/world/field/Columns.h"
#include "smartsurf/world/narrowphase/Distance.h"
#include "smartsurf/world/simd/Lanes.h"
#include "smartsurf/world/simd/Simd4.h"

namespace smartsurf::world {
namespace {

using scene::ShapeKind;

// Greatest slope of a line that lies on cells: the sine of the angle of kUpright.
constexpr float kMaxLineSlope = 0.0141F;
// Separations that differ by less belong to one resting contact, u.
constexpr float kSeparationTolerance = 2e-3F;
// Greatest distance of a contact from the face to which it belongs, u.
constexpr float kFaceTolerance = 0.01F;
// Mean distance of the points of a unit square from its centre.
constexpr float kSquareArm = 0.3826F;
constexpr int kMaxCorners = 32;

struct Point2 {
  float x, y;
};

// A flat face, or a line, of one part, in the horizontal plane; and its plane.
struct Footprint {
  Point2 corner[kMaxCorners];                      // counter-clockwise from above
  int count = 0;                                   // 2: a line
  float z = 0.0F, slope_x = 0.0F, slope_y = 0.0F;  // z + slope_x·(x − corner[0].x) + …
  float west = 0, east = 0, south = 0, north = 0;
  bool is_on_elastic_tops = false;
  float gap_entered = 0.0F;  // by the part, u

  float least_upright() const { return is_on_elastic_tops ? kUprightOnElasticTops : kUpright; }
  bool is_line() const { return count == 2; }
  // Rise of the plane from one point to another.
  float rise(float dx, float dy) const { return slope_x * dx + slope_y * dy; }
  float z_at(float x, float y) const { return z + slope_x * (x - corner[0].x) + slope_y * (y - corner[0].y); }
  // True if a point is on the face, or just beside it.
  bool has_near(const Vec3& p) const {
    return std::abs(z_at(p.x(), p.y()) - p.z()) <= kFaceTolerance && p.x() >= west - kFaceTolerance &&
           p.x() <= east + kFaceTolerance && p.y() >= south - kFaceTolerance &&
           p.y() <= north + kFaceTolerance;
  }
  void add(const Vec3& p) { corner[count++] = {p.x(), p.y()}; }
};

void set_bounds(Footprint& f) {
  f.west = f.south = std::numeric_limits<float>::max();
  f.east = f.north = -f.west;
  for (int i = 0; i < f.count; ++i) {
    f.west = std::min(f.west, f.corner[i].x), f.east = std::max(f.east, f.corner[i].x);
    f.south = std::min(f.south, f.corner[i].y), f.north = std::max(f.north, f.corner[i].y);
  }
}

// The underside's disc as a polygon of the same area. Its corners do not follow the body's spin.
void add_disc(Footprint& f, const Vec3& middle, float radius) {
  constexpr int kCorners = 24;
  static const auto kUnit = [] {
    std::array<Point2, kCorners> unit;
    const double angle = 2.0 * std::numbers::pi / kCorners, scale = std::sqrt(angle / std::sin(angle));
    for (int i = 0; i < kCorners; ++i)
      unit[i] = {static_cast<float>(scale * std::cos(i * angle)),
                 static_cast<float>(scale * std::sin(i * angle))};
    return unit;
  }();
  for (const Point2& u : kUnit) f.add(middle + radius * Vec3(u.x, u.y, 0));
}

bool set_plane(Footprint& f, const Vec3& point, const Vec3& up) {
  if (up.z() < f.least_upright()) return false;
  f.slope_x = -up.x() / up.z(), f.slope_y = -up.y() / up.z();
  f.z = point.z() + f.slope_x * (f.corner[0].x - point.x()) + f.slope_y * (f.corner[0].y - point.y());
  return true;
}

bool set_line(Footprint& f, const Vec3& from, const Vec3& to) {
  const Vec3 along = to - from;
  const float length = length_of(along.x(), along.y());
  if (std::abs(along.z()) > kMaxLineSlope * length) return false;
  f.add(from), f.add(to);
  f.z = from.z();
  f.slope_x = along.z() * along.x() / (length * length),
  f.slope_y = along.z() * along.y() / (length * length);
  return true;
}

bool box_footprint(const Shape& s, const Vec3& centre, const Mat3& axes, Footprint& f) {
  Eigen::Index axis = 0;
  axes.row(2).cwiseAbs().maxCoeff(&axis);
  const Vec3 up = axes.col(axis) * std::copysign(1.0F, axes(2, axis));
  if (up.z() < f.least_upright()) return false;
  const Eigen::Index u = (axis + 1) % 3, v = (axis + 2) % 3;
  const Vec3 middle = centre - up * s.half_extents[axis];
  const Vec3 along_u = axes.col(u) * s.half_extents[u], along_v = axes.col(v) * s.half_extents[v];
  f.add(middle - along_u - along_v), f.add(middle + along_u - along_v);
  f.add(middle + along_u + along_v), f.add(middle - along_u + along_v);
  return set_plane(f, middle, up);
}

bool hull_footprint(const ConvexHullShape& hull, const Vec3& centre, const Mat3& axes, Footprint& f) {
  const scene::ConvexHull& h = *hull.hull;
  const scene::ConvexHull::Face& face = h.faces[hull.face_normals.argmax(-axes.row(2).transpose())];
  const Vec3 up = axes * -face.normal;
  if (up.z() < f.least_upright()) return false;
  const std::uint32_t stride = (face.vertex_count + kMaxCorners - 1) / kMaxCorners;
  for (std::uint32_t i = 0; i < face.vertex_count; i += stride)
    f.add(centre + axes * h.vertices[h.face_vertices[face.first_vertex + i]]);
  return set_plane(f, centre + axes * h.vertices[h.face_vertices[face.first_vertex]], up);
}

// The flat underside of a part. False if it has none.
bool find_footprint(const ConvexPart& part, const Vec3& centre, const Mat3& axes, Footprint& f) {
  const Shape& s = part.shape;
  const Vec3 along = axes.col(2);
  f.count = 0;
  f.gap_entered = least_gap_entered(s.width, 2.0F * s.half_extents);
  bool found = false;
  switch (s.kind) {
    case ShapeKind::kSphere:
      return false;
    case ShapeKind::kBox:
      found = box_footprint(s, centre, axes, f);
      break;
    case ShapeKind::kSolid:
      found = hull_footprint(*part.hull, centre, axes, f);
      break;
    case ShapeKind::kCone:
      if (along.z() < f.least_upright()) return false;
      add_disc(f, centre + along * s.low, s.radius);
      found = set_plane(f, centre + along * s.low, along);
      break;
    case ShapeKind::kCylinder:
    case ShapeKind::kCapsule:
      if (s.kind == ShapeKind::kCylinder && std::abs(along.z()) > f.least_upright()) {
        const Vec3 up = along * std::copysign(1.0F, along.z()), middle = centre - up * s.high;
        add_disc(f, middle, s.radius);
        found = set_plane(f, middle, up);
      } else if (std::abs(along.z()) < kMaxLineSlope) {
        const Vec3 down = (along * along.z() - Vec3::UnitZ()).normalized() * s.radius;
        const float end = s.kind == ShapeKind::kCapsule ? std::max(0.0F, s.high - s.radius) : s.high;
        found = set_line(f, centre + down - along * end, centre + down + along * end);
      }
      break;
  }
  if (found) set_bounds(f);
  return found;
}

struct SharedArea {
  float x, y, weight, arm;                // where it bears, from the cell's centre; as SupportSamples
  float xx = 0.0F, xy = 0.0F, yy = 0.0F;  // on elastic tops: mean squares of the distances from there
};

// A face bears on the whole area that it shares with a cell if it touches it everywhere, and on the lowest
// corners if it tilts: a corner bears the less the farther it is above the cell's top, or above the lowest
// corner if that is higher, down to nothing at kBearingGap, u.
constexpr float kBearingGap = 1e-3F;
float weight_of_corner(float separation, float lowest) {
  return std::clamp(1.0F - (separation - std::max(lowest, 0.0F)) / kBearingGap, 0.0F, 1.0F);
}

// Moves the point at which an area bears from its centre to the corners that bear; not on elastic tops, whose
// corners are springs. `separation`: of the face from the cell's top in the cell's middle.
void move_to_bearing_corners(const Footprint& f, float separation, const Point2* corner, int count,
                             SharedArea& area) {
  if (f.is_on_elastic_tops) return;
  float low = f.rise(corner[0].x, corner[0].y), high = low;
  for (int i = 1; i < count; ++i) {
    const float rise = f.rise(corner[i].x, corner[i].y);
    low = std::min(low, rise), high = std::max(high, rise);
  }
  const float lowest = separation + low, least = weight_of_corner(separation + high, lowest);
  if (least == 1.0F) return;
  float sum = 0.0F;
  Point2 bearing{0.0F, 0.0F};
  for (int i = 0; i < count; ++i) {
    const float weight = weight_of_corner(separation + f.rise(corner[i].x, corner[i].y), lowest);
    sum += weight, bearing.x += weight * corner[i].x, bearing.y += weight * corner[i].y;
  }
  area.x += (1.0F - least) * (bearing.x / sum - area.x);
  area.y += (1.0F - least) * (bearing.y / sum - area.y);
}

// The part of a line on a column; both from the cell's centre.
bool share_line(const Footprint& f, float separation, const Point2& from, const Point2& to, const Column& q,
                SharedArea& out) {
  float begin = 0.0F, end = 1.0F;
  auto clip = [&](float at, float step, float low, float high) {
    if (std::abs(step) < 1e-9F) {
      if (at < low || at > high) end = -1.0F;
      return;
    }
    const float a = (low - at) / step, b = (high - at) / step;
    begin = std::max(begin, std::min(a, b)), end = std::min(end, std::max(a, b));
  };
  const float dx = to.x - from.x, dy = to.y - from.y;
  clip(from.x, dx, q.west, q.east);
  clip(from.y, dy, q.south, q.north);
  if (!(end > begin)) return false;
  const float middle = 0.5F * (begin + end), length = (end - begin) * length_of(dx, dy);
  out = {from.x + middle * dx, from.y + middle * dy,
         std::min(1.0F, length / std::min(q.east - q.west, q.north - q.south)), 0.25F * length};
  const float squared = (end - begin) * (end - begin) / 12.0F;
  out.xx = squared * dx * dx, out.xy = squared * dx * dy, out.yy = squared * dy * dy;
  const Point2 ends[2] = {{from.x + begin * dx, from.y + begin * dy}, {from.x + end * dx, from.y + end * dy}};
  move_to_bearing_corners(f, separation, ends, 2, out);
  return true;
}

// Sets the second moments of a convex polygon.
void set_moments(const Point2* corner, int count, SharedArea& out) {
  float area = 0.0F, xx = 0.0F, xy = 0.0F, yy = 0.0F;
  for (int i = 1; i + 1 < count; ++i) {
    const Point2 a{corner[0].x - out.x, corner[0].y - out.y}, b{corner[i].x - out.x, corner[i].y - out.y},
        c{corner[i + 1].x - out.x, corner[i + 1].y - out.y};
    const float twice = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x), x = a.x + b.x + c.x,
                y = a.y + b.y + c.y;
    area += twice;
    xx += twice * (a.x * a.x + b.x * b.x + c.x * c.x + x * x);
    xy += twice * (a.x * a.y + b.x * b.y + c.x * c.y + x * y);
    yy += twice * (a.y * a.y + b.y * b.y + c.y * c.y + y * y);
  }
  const float scale = 1.0F / (12.0F * area);
  out.xx = scale * xx, out.xy = scale * xy, out.yy = scale * yy;
}

// The part of a convex polygon in the rectangle. Corners are relative to its centre.
bool share_polygon(const Footprint& f, float separation, const Point2* corner, int count, float half_x,
                   float half_y, SharedArea& out) {
  Point2 buffer[2][kMaxCorners + 4];
  const Point2* current = corner;
  int to = 0;
  float beyond[kMaxCorners + 5];  // how far each corner is beyond the side; the first again at the end
  for (int side = 0; side < 4; ++side) {
    Point2* const next = buffer[to];
    const float half = side < 2 ? half_x : half_y, sign = side % 2 == 0 ? 1.0F : -1.0F;
    bool is_clipped = false;
    for (int i = 0; i < count; ++i) {
      beyond[i] = sign * (side < 2 ? current[i].x : current[i].y) - half;
      is_clipped |= beyond[i] > 0.0F;
    }
    if (!is_clipped) continue;
    beyond[count] = beyond[0];
    int kept = 0;
    for (int i = 0; i < count; ++i) {
      const Point2 &p = current[i], &q = current[i + 1 < count ? i + 1 : 0];
      const float a = beyond[i], b = beyond[i + 1];
      if (a <= 0.0F) next[kept++] = p;
      if ((a < 0.0F && b > 0.0F) || (a > 0.0F && b < 0.0F)) {
        const float t = a / (a - b);
        next[kept++] = {p.x + t * (q.x - p.x), p.y + t * (q.y - p.y)};
      }
    }
    if (kept < 3) return false;
    current = next, count = kept, to = 1 - to;
  }
  float area = 0.0F, x = 0.0F, y = 0.0F;  // twice the area, and six times its moments
  for (int i = 1; i + 1 < count; ++i) {
    const Point2 &a = current[0], &b = current[i], &c = current[i + 1];
    const float twice = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
    area += twice, x += twice * (a.x + b.x + c.x), y += twice * (a.y + b.y + c.y);
  }
  const float full = 4.0F * half_x * half_y;
  if (!(area > 1e-6F * full)) return false;
  out = {x / (3.0F * area), y / (3.0F * area), std::min(1.0F, 0.5F * area / full),
         kSquareArm * std::sqrt(0.5F * area)};
  if (f.is_on_elastic_tops) set_moments(current, count, out);
  move_to_bearing_corners(f, separation, current, count, out);
  return true;
}

// Finds the cells under a footprint and the area that they share with it.
class FootprintOnCells {
 public:
  FootprintOnCells(const surface::Field& field, const Footprint& f)
      : f_(f), half_x_(field.half_top_x), half_y_(field.half_top_y), bridge_(0.5F * max_bridged_gap(field)) {
    if (f.is_line()) return;
    float area = 0.0F;
    for (int i = 0; i < f.count; ++i) {
      const Point2 &a = f.corner[i], &b = f.corner[i + 1 < f.count ? i + 1 : 0];
      area += (a.x - f.corner[0].x) * (b.y - f.corner[0].y) - (a.y - f.corner[0].y) * (b.x - f.corner[0].x);
    }
    if (area < 0.0F) {
      std::reverse(f_.corner, f_.corner + f_.count);
      f_.z = f.z_at(f_.corner[0].x, f_.corner[0].y);
    }
    for (int i = 0; i < f.count; ++i) {
      const Point2 &a = f_.corner[i], &b = f_.corner[i + 1 < f.count ? i + 1 : 0];
      const float x = b.y - a.y, y = a.x - b.x;
      edge_x_[i] = x, edge_y_[i] = y, offset_[i] = x * a.x + y * a.y;
      reach_[i] = std::abs(x) * half_x_ + std::abs(y) * half_y_;
    }
    for (int i = f.count; i % kSimd4Width != 0; ++i)  // the first edge again
      edge_x_[i] = edge_x_[0], edge_y_[i] = edge_y_[0], offset_[i] = offset_[0], reach_[i] = reach_[0];
  }
  // How far the face rises from the middle of a cell to its edge, at most, u.
  float greatest_rise() const {
    const float reach = f_.is_line() ? bridge_ : 0.0F;
    return std::abs(f_.slope_x) * (half_x_ + reach) + std::abs(f_.slope_y) * (half_y_ + reach);
  }
  // A line lies on the bridged column, `column`() from the cell's centre; a face bears on the top.
  template <class MakeColumn>
  bool share(float x, float y, float top, MakeColumn column, SharedArea& out) const {
    const float separation = f_.z_at(x, y) - top;
    if (f_.is_line())
      return share_line(f_, separation, {f_.corner[0].x - x, f_.corner[0].y - y},
                        {f_.corner[1].x - x, f_.corner[1].y - y}, column(), out);
    Int4 is_outside{}, is_cut{};
    for (int i = 0; i < f_.count; i += kSimd4Width) {
      const Float4 reach = load4(reach_ + i),
                   beyond = x * load4(edge_x_ + i) + y * load4(edge_y_ + i) - load4(offset_ + i);
      is_outside |= beyond >= reach;
      is_cut |= beyond > -reach;
    }
    if (any_of(is_outside)) return false;
    if (!any_of(is_cut)) {
      out = {0.0F, 0.0F, 1.0F, kSquareArm * std::sqrt(4.0F * half_x_ * half_y_)};
      out.xx = half_x_ * half_x_ / 3.0F, out.yy = half_y_ * half_y_ / 3.0F;
      const Point2 corners[4] = {
          {-half_x_, -half_y_}, {half_x_, -half_y_}, {half_x_, half_y_}, {-half_x_, half_y_}};
      move_to_bearing_corners(f_, separation, corners, 4, out);
      return true;
    }
    Point2 local[kMaxCorners];
    for (int i = 0; i < f_.count; ++i) local[i] = {f_.corner[i].x - x, f_.corner[i].y - y};
    return share_polygon(f_, separation, local, f_.count, half_x_, half_y_, out);
  }

 private:
  Footprint f_;
  float half_x_, half_y_, bridge_;
  // Outward normal · p ≤ offset inside; extent of a top along the normal. In whole vectors.
  alignas(16) float edge_x_[kMaxCorners], edge_y_[kMaxCorners], offset_[kMaxCorners], reach_[kMaxCorners];
};

// Which cells under a body's flat underside bear it: those that touch it as closely as the contacts that
// carry it.
struct BearingContacts {
  const surface::Field& field;
  float margin;
  bool on_elastic_tops = false;  // then these alone bear the body
  float min_separation = std::numeric_limits<float>::max();
  float min_top = std::numeric_limits<float>::max();  // of the closest contacts
  bool bears(float separation, float top, std::int32_t cell) const {
    if (separation > margin) return false;
    if (on_elastic_tops) return field.is_elastic(cell);
    if (separation <= min_separation + kSeparationTolerance) return true;
    // Cells with force limits that move yield until every cell bears that is as high as the lowest bearing
    // one.
    return field.has_force_limit() && field.speed[cell] != 0.0F && top >= min_top - kLevelTolerance;
  }
};

bool is_upright(const Contact& c) { return c.partner == Partner::kCell && c.normal.z() > kUpright; }

BearingContacts bearing_contacts(const surface::Field& field, std::span<const Contact> contacts,
                                 float margin) {
  BearingContacts b{.field = field, .margin = margin};
  for (const Contact& c : contacts)
    if (is_upright(c)) b.min_separation = std::min(b.min_separation, c.separation);
  for (const Contact& c : contacts)
    if (is_upright(c) && c.separation <= b.min_separation + kSeparationTolerance)
      b.min_top = std::min(b.min_top, field.column_height()[c.feature_id]);
  return b;
}

// See SupportSamples.
struct Sample {
  std::int32_t cell;
  float x, y, arm, weight, separation, velocity_x, velocity_y, spin;
  float xx = 0.0F, xy = 0.0F, yy = 0.0F;  // as SharedArea
};

void add_sample(const surface::Field& field, std::int32_t cell, const Vec3& centre, const Point2& cell_centre,
                const SharedArea& shared, float separation, std::vector<Sample>& out) {
  float vx = 0.0F, vy = 0.0F, spin = 0.0F;
  if (field.has_surface_velocity()) {
    if (!field.surface_spin.empty()) spin = field.surface_spin[cell];
    vx = field.surface_velocity_x[cell] - spin * shared.y;
    vy = field.surface_velocity_y[cell] + spin * shared.x;
  }
  out.push_back({cell, cell_centre.x + shared.x - centre.x(), cell_centre.y + shared.y - centre.y(),
                 shared.arm, shared.weight, separation, vx, vy, spin, shared.xx, shared.xy, shared.yy});
}

// Adds the samples of one footprint, by ascending cell.
void add_samples(const surface::Field& field, const Footprint& f, const Vec3& centre,
                 const BearingContacts& bearing, std::vector<Sample>& out) {
  const Columns columns(field, f.gap_entered);
  const CellRange cells = columns.cells_covering(f.west, f.east, f.south, f.north);
  const FootprintOnCells on_cells(field, f);
  for (int r = cells.row_begin; r < cells.row_end; ++r)
    for (int c = cells.column_begin; c < cells.column_end; ++c) {
      const float x = columns.x(c), y = columns.y(r), top = columns.top(r, c);
      const int cell = columns.index(r, c);
      const auto column = [&] {
        Column q = columns.at(r, c);
        q.west -= x, q.east -= x, q.south -= y, q.north -= y;
        return q;
      };
      SharedArea shared;
      if (!bearing.bears(f.z_at(x, y) - on_cells.greatest_rise() - top, top, cell) ||
          !on_cells.share(x, y, top, column, shared))
        continue;
      const float separation = f.z_at(x + shared.x, y + shared.y) - top;
      if (bearing.on_elastic_tops || bearing.bears(separation, top, cell))
        add_sample(field, cell, centre, {x, y}, shared, separation, out);
    }
}

// The same for a field of cells at any place and angle.
void add_samples(const surface::Field& field, const FreeLayoutField& layout, const Footprint& f,
                 const Vec3& centre, const BearingContacts& bearing, std::vector<Sample>& out) {
  thread_local std::vector<std::int32_t> cells;
  layout.find_cells({f.west, f.south, 0}, {f.east, f.north, 0}, cells);
  for (const std::int32_t cell : cells) {
    const Point2 at{field.x[cell], field.y[cell]};
    const float top = field.column_height()[cell];
    const float angle = field.angle_of(cell), sine = std::sin(angle), cosine = std::cos(angle);
    Footprint local = f;  // in the axes of the cell
    local.slope_x = cosine * f.slope_x + sine * f.slope_y,
    local.slope_y = cosine * f.slope_y - sine * f.slope_x;
    for (int k = 0; k < f.count; ++k) {
      const float x = f.corner[k].x - at.x, y = f.corner[k].y - at.y;
      local.corner[k] = {cosine * x + sine * y, cosine * y - sine * x};
    }
    const auto column = [&] {
      const auto [west, east] = std::minmax(local.corner[0].x, local.corner[1].x);
      const auto [south, north] = std::minmax(local.corner[0].y, local.corner[1].y);
      return layout.column(cell, {west, south, 0}, {east, north, 0}, f.gap_entered);
    };
    SharedArea shared;
    const FootprintOnCells on_cells(field, local);
    if (!bearing.bears(f.z_at(at.x, at.y) - on_cells.greatest_rise() - top, top, cell) ||
        !on_cells.share(0.0F, 0.0F, top, column, shared))
      continue;
    const float x = shared.x;
    shared.x = cosine * x - sine * shared.y;
    shared.y = sine * x + cosine * shared.y;
    const float xx = shared.xx, xy = shared.xy, yy = shared.yy, both = 2.0F * sine * cosine * xy;
    shared.xx = cosine * cosine * xx - both + sine * sine * yy;
    shared.xy = sine * cosine * (xx - yy) + (cosine * cosine - sine * sine) * xy;
    shared.yy = sine * sine * xx + both + cosine * cosine * yy;
    const float separation = f.z_at(at.x + shared.x, at.y + shared.y) - top;
    if (bearing.on_elastic_tops || bearing.bears(separation, top, cell))
      add_sample(field, cell, centre, at, shared, separation, out);
  }
}

// Merges samples on the same cell, which several parts of a body share, and restores the order.
void merge_cells(bool on_elastic_tops, std::vector<Sample>& samples) {
  std::ranges::stable_sort(samples, {}, &Sample::cell);
  std::size_t to = 0;
  for (const Sample& s : samples) {
    if (to == 0 || samples[to - 1].cell != s.cell) {
      samples[to++] = s;
      continue;
    }
    // The arm stands for the size of the area. Of a tilted face the parts that are lowest bear, unless all
    // are springs.
    Sample& sum = samples[to - 1];
    const auto weight = [&, lowest = std::min(sum.separation, s.separation)](float separation) {
      return on_elastic_tops ? 1.0F : weight_of_corner(separation, lowest);
    };
    const float a = sum.arm * sum.arm, b = s.arm * s.arm, bearing_a = a * weight(sum.separation),
                bearing_b = b * weight(s.separation),
                share = bearing_b / std::max(1e-12F, bearing_a + bearing_b);
    const float x = s.x - sum.x, y = s.y - sum.y, apart = share * (1.0F - share);
    for (float Sample::*const value : {&Sample::x, &Sample::y, &Sample::velocity_x, &Sample::velocity_y,
                                       &Sample::separation, &Sample::xx, &Sample::xy, &Sample::yy})
      sum.*value += share * (s.*value - sum.*value);
    sum.xx += apart * x * x, sum.xy += apart * x * y, sum.yy += apart * y * y;
    sum.arm = std::sqrt(a + b);
    sum.weight = std::min(1.0F, sum.weight + s.weight);
  }
  samples.resize(to);
}

// Appends the samples of a patch, padded.
void append(std::span<const Sample> samples, bool has_limits, SupportSamples& out) {
  std::size_t i = out.size();
  out.resize(i + (samples.size() + kLanes - 1) / kLanes * kLanes, has_limits);
  for (const Sample& s : samples) {
    out.cell[i] = s.cell;
    out.x[i] = s.x, out.y[i] = s.y, out.arm[i] = s.arm, out.weight[i] = s.weight;
    out.velocity_x[i] = s.velocity_x, out.velocity_y[i] = s.velocity_y, out.spin[i] = s.spin;
    out.separation[i++] = s.separation;
  }
}

// Finds the shares of a patch's points. A sample moves to where its points can balance its load; one without
// points gets the weight 0. False if no sample has points.
bool add_shares(const SupportPatch& patch, std::span<const Contact> contacts, SupportPatches& out) {
  struct Points {
    float lowest = std::numeric_limits<float>::max();  // separation
    float least_weight = 1.0F, weight = 0.0F;          // of the corners, and their sum
    int count = 0;
    float x = 0, y = 0;                                    // mean
    float xx = 0, xy = 0, yy = 0;                          // second moments about the mean
    float offset_x = 0, offset_y = 0, least_share = 1.0F;  // of the sample from the mean
  };
  thread_local std::vector<Points> of_sample;
  of_sample.assign(patch.count, {});
  SupportSamples& s = out.samples;
  const std::size_t first = patch.first, first_point = patch.first_point;
  const auto cells = std::span(s.cell).subspan(first, patch.count);
  out.shares.resize(out.points.size());
  // Calls each(share, points of its sample, contact) for the points that have a sample.
  auto for_each_share = [&](auto each) {
    for (std::size_t k = first_point; k < out.points.size(); ++k)
      if (PointShare& share = out.shares[k]; share.sample >= 0)
        each(share, of_sample[share.sample], contacts[out.points[k]]);
  };
  for (std::size_t k = first_point; k < out.points.size(); ++k) {
    const std::int32_t cell = contacts[out.points[k]].feature_id;
    const auto found = std::lower_bound(cells.begin(), cells.end(), cell);
    out.shares[k] = {};
    if (found != cells.end() && *found == cell)
      out.shares[k].sample = static_cast<std::int32_t>(found - cells.begin());
  }
  for_each_share([](PointShare&, Points& p, const Contact& c) {
    ++p.count, p.x += c.anchor.x(), p.y += c.anchor.y();
    p.lowest = std::min(p.lowest, c.separation);
  });
  bool any = false;
  for (std::size_t i = 0; i < of_sample.size(); ++i) {
    Points& p = of_sample[i];
    if (p.count == 0) {
      s.weight[first + i] = 0.0F;
      continue;
    }
    any = true;
    p.x /= static_cast<float>(p.count), p.y /= static_cast<float>(p.count);
    p.offset_x = s.x[first + i] - p.x, p.offset_y = s.y[first + i] - p.y;
    s.x[first + i] = p.x, s.y[first + i] = p.y;
  }
  for_each_share([](PointShare&, Points& p, const Contact& c) {
    const float x = c.anchor.x() - p.x, y = c.anchor.y() - p.y;
    const float weight = weight_of_corner(c.separation, p.lowest);
    p.weight += weight, p.least_weight = std::min(p.least_weight, weight);
    p.xx += x * x, p.xy += x * y, p.yy += y * y;
  });
  for_each_share([](PointShare& share, Points& p, const Contact& c) {
    constexpr float kNoMoment = 1e-6F;  // u²
    const float x = c.anchor.x() - p.x, y = c.anchor.y() - p.y, xx = p.xx + kNoMoment, yy = p.yy + kNoMoment,
                determinant = xx * yy - p.xy * p.xy;
    share.share_x = (yy * x - p.xy * y) / determinant;
    share.share_y = (xx * y - p.xy * x) / determinant;
    share.share = 1.0F / static_cast<float>(p.count);
    p.least_share =
        std::min(p.least_share, share.share + share.share_x * p.offset_x + share.share_y * p.offset_y);
  });
  // A level face bears on all points of a cell, a tilted one on the lowest.
  for_each_share([&](PointShare& share, const Points& p, const Contact& c) {
    const std::size_t i = first + share.sample;
    if (p.least_share >= 0.0F) share.share += share.share_x * p.offset_x + share.share_y * p.offset_y;
    const float tilted = 1.0F - p.least_weight;
    share.share += tilted * (weight_of_corner(c.separation, p.lowest) / p.weight - share.share);
    share.share_x *= 1.0F - tilted, share.share_y *= 1.0F - tilted;
    s.x[i] += share.share * (c.anchor.x() - p.x), s.y[i] += share.share * (c.anchor.y() - p.y);
  });
  return any;
}

// Appends the cells of points that do not bear as the samples do, and are not among these.
void add_outliers(const SupportPatch& patch, const SupportPatches& list, std::span<const Contact> contacts,
                  const BearingContacts& bearing, std::vector<Sample>& samples) {
  for (const std::int32_t k : std::span(list.points).subspan(patch.first_point)) {
    const Contact& c = contacts[k];
    if (bearing.bears(c.separation, bearing.field.column_height()[c.feature_id], c.feature_id) ||
        std::ranges::find(samples, c.feature_id, &Sample::cell) != samples.end())
      continue;
    samples.push_back({c.feature_id, c.anchor.x(), c.anchor.y(), 0, 0, c.separation, 0, 0, 0});
  }
}

// The sum of the stiffnesses of the elastic tops that would bear the face if they were rigid, mass/s².
float stiffness_under(const BearingContacts& bearing, std::span<const Sample> samples) {
  float stiffness = 0.0F;
  for (const Sample& s : samples)
    if (s.separation <= bearing.min_separation + kSeparationTolerance)
      stiffness += s.weight * bearing.field.tip_at(s.cell).stiffness;
  return stiffness;
}

// Finds out if the cells move, and if they do as one belt.
void set_motion(const surface::Field& field, std::span<const Sample> samples, SupportPatch& patch) {
  patch.belt_x = samples[0].velocity_x, patch.belt_y = samples[0].velocity_y;
  patch.is_one_belt = true;
  for (const Sample& s : samples) {
    const bool turns_or_rises = s.spin != 0.0F || field.speed[s.cell] != 0.0F;
    patch.turns |= s.spin != 0.0F;
    patch.moves |= s.velocity_x != 0.0F || s.velocity_y != 0.0F || turns_or_rises;
    patch.is_one_belt &= !turns_or_rises && s.velocity_x == patch.belt_x && s.velocity_y == patch.belt_y;
  }
}

// `slope`: of the face. The corners are those of a rectangle, or a parallelogram, of the area's moments.
void add_springs(const surface::Field& field, std::span<const Sample> samples, const Point2& slope,
                 const SupportPatch& patch, SupportPatches& out) {
  out.springs.resize(out.samples.size());
  Index i = patch.first;
  for (const Sample& s : samples) {
    const surface::CellTip& top = field.tip_at(s.cell);
    SupportSpring& spring = out.springs[i++] = {};
    spring.rise = field.speed[s.cell];
    spring.stiffness = s.weight * top.stiffness, spring.damping = s.weight * top.damping;
    const float ux = std::sqrt(3.0F * s.xx), uy = ux > 0.0F ? 3.0F * s.xy / ux : 0.0F,
                vy = std::sqrt(std::max(0.0F, 3.0F * s.yy - uy * uy));
    for (std::size_t k = 0; k < spring.corner.size(); ++k) {
      const float u = k % 2 == 0 ? -1.0F : 1.0F, v = k < 2 ? -1.0F : 1.0F, x = u * ux, y = u * uy + v * vy;
      spring.corner[k] = {.x = s.x + x, .y = s.y + y, .separation = s.separation + slope.x * x + slope.y * y};
    }
  }
}

bool may_be_flat(const Shape& s, const Mat3& axes, float least_upright) {
  if (s.kind == ShapeKind::kBox) return axes.row(2).cwiseAbs().maxCoeff() > least_upright;
  if (!s.is_axisymmetric()) return true;
  const float along = std::abs(axes(2, 2));
  return along > least_upright || along < kMaxLineSlope;
}

}  // namespace

void SupportSamples::resize(std::size_t n, bool has_limits) {
  cell.resize(n, -1);
  limit.resize(has_limits ? n : 0, kUnlimitedLoad);
  for (std::vector<float>* values :
       {&x, &y, &arm, &velocity_x, &velocity_y, &spin, &weight, &load, &separation})
    values->resize(n, 0.0F);
  for (auto& copy : friction)
    for (auto& values : copy) values.resize(n, 0.0F);
}

void SupportPatches::clear() {
  patches.clear();
  points.clear();
  shares.clear();
  springs.clear();
  if (!samples.cell.empty()) samples.resize(0, false);
}

bool add_support_patch(const surface::Field& field, const FreeLayoutField* free_layout,
                       const BodyStore& bodies, std::int32_t body, float margin, float max_stiffness,
                       std::span<const Contact> contacts, SupportPatches& out) {
  const Shape& shape = *bodies.shape[body];
  const Vec3 &centre = bodies.position[body], origin = bodies.origin(body);
  const Mat3& axes = bodies.axes[body];
  const float least_upright = field.has_elastic_tops ? kUprightOnElasticTops : kUpright;
  if (contacts.size() < 2 || !may_be_flat(shape, axes, least_upright)) return false;
  if (std::count_if(contacts.begin(), contacts.end(), is_upright) < 2) return false;
  SupportPatch& patch = out.patches.emplace_back();
  patch.body = body;
  patch.is_elastic = max_stiffness > 0.0F && std::ranges::any_of(contacts, [&](const Contact& c) {
                       return is_upright(c) && field.is_elastic(c.feature_id);
                     });
  patch.has_shares = field.has_force_limit() && !patch.is_elastic;
  const bool has_limits = field.has_contacts_per_cell();
  BearingContacts bearing = bearing_contacts(field, contacts, margin);
  bearing.on_elastic_tops = patch.is_elastic;
  patch.first = static_cast<std::int32_t>(out.samples.size());
  patch.first_point = static_cast<std::int32_t>(out.points.size());
  thread_local std::vector<Sample> samples;
  samples.clear();
  int footprints = 0;
  float plane_z = 0.0F;
  Point2 slope{0.0F, 0.0F};
  for_each_part(shape, [&](const ConvexPart& part) {
    Footprint f;
    f.is_on_elastic_tops = patch.is_elastic;
    if (!find_footprint(part, origin, axes, f)) return;
    // All samples of a patch lie in one plane; feet at other heights keep their contact points. Planes are
    // compared below the centre of mass: those of tilted feet differ elsewhere.
    const float below_centre = f.z_at(centre.x(), centre.y());
    if (footprints > 0 && std::abs(below_centre - plane_z) > kFaceTolerance) return;
    bool touches = false;
    for (std::size_t k = 0; k < contacts.size(); ++k) {
      const Contact& c = contacts[k];
      const auto index = static_cast<std::int32_t>(k);
      if (!is_upright(c) || !f.has_near(centre + c.anchor)) continue;
      // A lower cell has points of its own.
      if ((patch.has_shares || patch.is_elastic) &&
          !bearing.bears(c.separation, field.column_height()[c.feature_id], c.feature_id))
        continue;
      touches = true;
      if (footprints == 0 ||
          std::find(out.points.begin() + patch.first_point, out.points.end(), index) == out.points.end())
        out.points.push_back(index);
    }
    if (!touches) return;
    if (footprints++ == 0) {
      plane_z = below_centre;
      slope = {f.slope_x, f.slope_y};
      patch.z = f.z_at(0.5F * (f.west + f.east), 0.5F * (f.south + f.north)) - centre.z();
    }
    if (free_layout)
      add_samples(field, *free_layout, f, centre, bearing, samples);
    else
      add_samples(field, f, centre, bearing, samples);
  });
  if (footprints > 1) merge_cells(patch.is_elastic, samples);
  if (patch.is_elastic && stiffness_under(bearing, samples) > max_stiffness) {
    out.points.resize(patch.first_point);
    out.patches.pop_back();
    return add_support_patch(field, free_layout, bodies, body, margin, 0.0F, contacts, out);
  }
  patch.count = static_cast<std::int32_t>(samples.size());
  if (!patch.has_shares && !patch.is_elastic) add_outliers(patch, out, contacts, bearing, samples);
  patch.outlier_count = static_cast<std::int32_t>(samples.size()) - patch.count;
  append(samples, has_limits, out.samples);
  patch.point_count = static_cast<std::int32_t>(out.points.size()) - patch.first_point;
  if (patch.count < 1 || patch.point_count < 2 || (patch.has_shares && !add_shares(patch, contacts, out))) {
    out.samples.resize(patch.first, has_limits);
    out.points.resize(patch.first_point);
    if (!out.shares.empty()) out.shares.resize(out.points.size());
    out.patches.pop_back();
    return false;
  }
  const auto of_patch = std::span<const Sample>(samples).first(patch.count);
  set_motion(field, of_patch, patch);
  if (patch.is_elastic) add_springs(field, of_patch, slope, patch, out);
  return true;
}

void match_support_patch(const SupportPatches& previous, const SupportPatch& from, SupportPatches& current,
                         SupportPatch& to) {
  to.has_friction = true;
  // Calls each(sample of `from`, sample of `to`) for the cells of both.
  const auto for_each_common = [&](auto each) {
    std::size_t i = from.first;
    const std::size_t end = i + from.count;
    for (Index k = to.first; k < to.first + to.count; ++k) {
      while (i < end && previous.samples.cell[i] < current.samples.cell[k]) ++i;
      if (i < end && previous.samples.cell[i] == current.samples.cell[k]) each(i, k);
    }
  };
  if (to.is_elastic && from.is_elastic)
    for_each_common([&](Index i, Index k) { current.samples.load[k] = previous.samples.load[i]; });
  if (from.is_lumped) {
    std::copy_n(from.friction_sum, 3, to.friction_sum);
    to.is_lumped = true;
    return;
  }
  const auto& old_friction = previous.samples.friction[from.current];
  auto& friction = current.samples.friction[to.current];
  for_each_common([&](Index i, Index k) {
    for (std::size_t axis = 0; axis < 3; ++axis) friction[axis][k] = old_friction[axis][i];
  });
}

void append_patch(const SupportPatches& from, const SupportPatch& p, SupportPatches& to) {
  SupportPatch& copy = to.patches.emplace_back(p);
  copy.first = static_cast<std::int32_t>(to.samples.size());
  copy.first_point = static_cast<std::int32_t>(to.points.size());
  copy.point_count = copy.outlier_count = 0;
  to.samples.resize(to.samples.size() + p.count, !to.samples.limit.empty());
  const auto copy_samples = [&](const auto& source, auto& target) {
    std::copy_n(source.begin() + p.first, p.count, target.begin() + copy.first);
  };
  const SupportSamples& s = from.samples;
  SupportSamples& t = to.samples;
  copy_samples(s.cell, t.cell);
  for (const auto values :
       {&SupportSamples::x, &SupportSamples::y, &SupportSamples::arm, &SupportSamples::velocity_x,
        &SupportSamples::velocity_y, &SupportSamples::spin, &SupportSamples::weight, &SupportSamples::load})
    copy_samples(s.*values, t.*values);
  for (std::size_t i = 0; i < s.friction.size(); ++i)
    for (std::size_t axis = 0; axis < s.friction[i].size(); ++axis)
      copy_samples(s.friction[i][axis], t.friction[i][axis]);
}

void remove_body(SupportPatches& list, std::int32_t body) {
  std::erase_if(list.patches, [body](const SupportPatch& p) { return p.body == body; });
  for (SupportPatch& p : list.patches)
    if (p.body > body) --p.body;
}

}  // namespace smartsurf::world
