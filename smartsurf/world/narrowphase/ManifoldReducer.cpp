#include "smartsurf/world/narrowphase/ManifoldReducer.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "smartsurf/world/narrowphase/FeaturePoints.h"
#include "smartsurf/world/simd/Simd4.h"

namespace smartsurf::world {

void ManifoldReducer::add(const ManifoldCandidate& c) {
  if (count() == ReductionPoints::kCapacity) keep_selected();
  const int i = count();
  points_.add(c.point, c.separation);
  normal_[i] = c.normal;
  tag_[i] = c.tag;
}

void ManifoldReducer::keep_selected() {
  ManifoldCandidate kept[ReductionPoints::kMaxSelected];
  int n = 0;
  reduce([&](const ManifoldCandidate& c) { kept[n++] = c; });
  clear();
  for (int i = 0; i < n; ++i) add(kept[i]);
}

ManifoldCandidate ManifoldReducer::average() const {
  ManifoldCandidate m = at(0);
  for (int i = 1; i < count(); ++i) {
    m.point += points_.at(i);
    m.separation += points_.separation(i);
  }
  m.point /= static_cast<float>(count());
  m.separation /= static_cast<float>(count());
  return m;
}

float ManifoldReducer::min_separation() const {
  return count() > 0 ? points_.separation(points_.deepest()) : std::numeric_limits<float>::infinity();
}

float ManifoldReducer::twist_friction_loss(std::span<const Vec3> corners) const {
  const int n = count();
  const auto corner_count = static_cast<float>(corners.size());
  if (corners.size() < 2 || n < 2) return 0.0F;
  Vec3 middle = Vec3::Zero();
  for (const Vec3& p : corners) middle += p / corner_count;
  float corner_distance = 0.0F;
  for (const Vec3& p : corners) corner_distance += (p - middle).norm() / corner_count;
  if (!(corner_distance > 0.0F)) return 0.0F;
  // The patch's area and centre, by triangles, then its second moments about that.
  const Vec3 first = points_.at(0);
  float area = 0.0F;
  Vec3 centre = Vec3::Zero(), up = Vec3::Zero();
  for (int i = 2; i < n; ++i) {
    const Vec3 from = points_.at(i - 1) - first, to = points_.at(i) - first, cross = from.cross(to);
    const float part = 0.5F * cross.norm();
    area += part, centre += (part / 3.0F) * (from + to), up += cross;
  }
  // Mean distance from the centre, in parts of the root of the mean square: of an edge, and of a square.
  // Between them by the fourth root of the ratio of the principal moments, to 1 %.
  constexpr float kOfEdge = 0.866F, kOfSquare = 0.937F;
  if (area <= 1e-4F * corner_distance * corner_distance) return 0.5F;  // an edge
  centre = first + centre / area;
  const Vec3 east = (first - centre).normalized(), north = up.normalized().cross(east);
  float xx = 0.0F, xy = 0.0F, yy = 0.0F, least = 1e30F, greatest = 0.0F;
  for (int i = 0; i < n; ++i) {
    const Vec3 p = points_.at(i) - centre, q = points_.at((i + 1) % n) - centre;
    const float px = p.dot(east), py = p.dot(north), qx = q.dot(east), qy = q.dot(north);
    const float part = std::abs(px * qy - py * qx) / 24.0F;
    xx += part * (px * px + px * qx + qx * qx) * 2.0F;
    yy += part * (py * py + py * qy + qy * qy) * 2.0F;
    xy += part * (2.0F * px * py + px * qy + qx * py + 2.0F * qx * qy);
    const float squared = px * px + py * py;
    least = std::min(least, squared), greatest = std::max(greatest, squared);
  }
  float mean = 0.0F;
  if (n >= kRimPoints && greatest - least < 2e-3F * greatest) {
    mean = 2.0F / 3.0F * std::sqrt(greatest);  // of the disc around them
  } else {
    const float half = 0.5F * (xx + yy),
                spread = std::min(half, std::sqrt(0.25F * (xx - yy) * (xx - yy) + xy * xy));
    const float ratio = (half - spread) / (half + spread);
    mean = (kOfEdge + (kOfSquare - kOfEdge) * std::sqrt(std::sqrt(ratio))) * std::sqrt((xx + yy) / area);
  }
  return std::clamp(1.0F - mean / corner_distance, 0.0F, 0.9F);
}

int ReductionPoints::deepest() const {
  int best = 0;
  for (int i = 1; i < count_; ++i) best = separation_[i] < separation_[best] ? i : best;
  return best;
}

namespace {

struct Points {
  Float4 x, y, z;
};
Float4 squared_length(const Points& p) { return p.x * p.x + p.y * p.y + p.z * p.z; }
Points relative_to(const Vec3& q, const Points& p) { return {p.x - q.x(), p.y - q.y(), p.z - q.z()}; }
Points perpendicular(const Vec3& unit, const Points& p) {
  return {p.y * unit.z() - p.z * unit.y(), p.z * unit.x() - p.x * unit.z(), p.x * unit.y() - p.y * unit.x()};
}

}  // namespace

template <class Spread>
int ReductionPoints::argmax(Spread measure) const {
  static_assert(kCapacity % kSimd4Width == 0);
  // Branch-free, because the outcome is unpredictable: positive floats order like their bits, so the low bits
  // can carry the index. The first of nearly equal scores wins.
  constexpr std::int32_t kIndexMask = 127;
  static_assert(kCapacity <= kIndexMask);
  Int4 best{}, index_bits = Int4{kIndexMask, kIndexMask - 1, kIndexMask - 2, kIndexMask - 3};
  for (int i = 0; i < count_; i += kSimd4Width, index_bits -= kSimd4Width) {
    const Float4 separation = load4(separation_ + i);
    const Float4 score = measure(Points{load4(x_ + i), load4(y_ + i), load4(z_ + i)}) -
                         (separation > 0.0F ? separation : Float4{});
    const Int4 candidate = score > 1e-3F ? (as_int_bits(score) & ~kIndexMask) | index_bits : Int4{};
    best = candidate > best ? candidate : best;
  }
  const std::int32_t first = horizontal_max(best);
  return first == 0 ? -1 : kIndexMask - (first & kIndexMask);
}

int ReductionPoints::select_widest(int (&chosen)[kMaxSelected]) {
  if (count_ == 0) return 0;
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  chosen[0] = deepest();
  if (separation_[chosen[0]] == kInfinity) return 0;
  if (count_ == 1) return 1;
  for (int i = count_; i % kSimd4Width != 0; ++i) set(i, at(0), kInfinity);
  const Vec3 a = at(chosen[0]);
  chosen[1] = argmax([&](const Points& p) { return sqrt(squared_length(relative_to(a, p))); });
  if (chosen[1] < 0) return 1;
  const Vec3 b = at(chosen[1]);
  const Vec3 along = (b - a) / std::max(1e-6F, (b - a).norm());
  chosen[2] =
      argmax([&](const Points& p) { return sqrt(squared_length(perpendicular(along, relative_to(a, p)))); });
  if (chosen[2] < 0) return 2;
  const Vec3 c = at(chosen[2]);
  chosen[3] = argmax([&](const Points& p) {
    return sqrt(min(min(squared_length(relative_to(a, p)), squared_length(relative_to(b, p))),
                    squared_length(relative_to(c, p))));
  });
  return chosen[3] < 0 ? 3 : 4;
}

// Quickhull: adds the point that is farthest beyond a side, and so on.
int ReductionPoints::extend(const Vec3* load_point, const Vec3& normal, int candidates,
                            int (&chosen)[kMaxSelected]) const {
  constexpr float kTolerance = 1e-3F;          // u
  constexpr float kRelativeTolerance = 0.02F;  // of the distance between the first two
  const Vec3 origin = load_point ? *load_point : at(chosen[0]);
  const Vec3 east = normal.unitOrthogonal(), north = normal.cross(east);
  struct InPlane {
    float u, v;
  };
  const auto in_plane = [&](int i) {
    const Vec3 offset = at(i) - origin;
    return InPlane{east.dot(offset), north.dot(offset)};
  };
  InPlane corner[kMaxSelected];
  int count = 4;
  for (int i = 0; i < count; ++i) corner[i] = in_plane(chosen[i]);
  const float relative = kRelativeTolerance * (at(chosen[1]) - at(chosen[0])).norm();
  const float least_extension = load_point ? kTolerance : std::max(kTolerance, relative);
  // A side of the area; (u, v) is its outward normal.
  struct Side {
    float u = 0.0F, v = 0.0F, offset = 0.0F;
    float height(const InPlane& p) const { return p.u * u + p.v * v - offset; }
  };
  while (count < kMaxSelected) {
    int farthest = -1;
    float most = least_extension;
    for (int i = 0; i < count; ++i)
      for (int k = 0; k < count; ++k) {
        const float du = corner[k].u - corner[i].u, dv = corner[k].v - corner[i].v;
        const float length = std::sqrt(du * du + dv * dv);
        if (!(length > kTolerance)) continue;
        Side side{dv / length, -du / length};
        side.offset = side.height(corner[i]);
        if (load_point && side.offset >= relative) continue;
        if (!std::all_of(corner, corner + count,
                         [&](const InPlane& p) { return side.height(p) <= kTolerance; }))
          continue;
        for (int c = 0; c < candidates; ++c) {
          const float extension = side.height(in_plane(c)) - std::max(0.0F, separation_[c]);
          if (extension > most) most = extension, farthest = c;
        }
      }
    if (farthest < 0) break;
    chosen[count] = farthest, corner[count] = in_plane(farthest);
    ++count;
  }
  return count;
}

int find_planes(std::span<const ManifoldCandidate> candidates, std::vector<int>& plane) {
  constexpr float kSameNormal = 0.9999F, kSameOffset = 1e-3F;  // cosine; u
  struct Plane {
    Vec3 normal;
    float offset;
  };
  thread_local std::vector<Plane> planes;
  planes.clear();
  plane.clear();
  for (const ManifoldCandidate& c : candidates) {
    const float offset = c.normal.dot(c.point);
    const auto found = std::ranges::find_if(planes, [&](const Plane& p) {
      return p.normal.dot(c.normal) > kSameNormal && std::abs(p.offset - offset) <= kSameOffset;
    });
    plane.push_back(static_cast<int>(found - planes.begin()));
    if (found == planes.end()) planes.push_back({c.normal, offset});
  }
  return static_cast<int>(planes.size());
}

}  // namespace smartsurf::world
