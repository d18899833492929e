#include "smartsurf/world/narrowphase/ManifoldReducer.h"

#include <algorithm>
#include <cstdint>
#include <limits>

#include "smartsurf/world/narrowphase/Simd4.h"

namespace smartsurf::world {

void ManifoldReducer::add(const ManifoldCandidate& c) {
  int i = count();
  if (i < ReductionPoints::kCapacity) {
    points_.add(c.point, c.separation);
  } else {
    i = points_.most_separated();
    if (!(c.separation < points_.separation(i))) return;
    points_.set(i, c.point, c.separation);
  }
  normal_[i] = c.normal;
  tag_[i] = c.tag;
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

int ReductionPoints::deepest() const {
  int found = 0;
  for (int i = 1; i < count_; ++i) found = separation_[i] < separation_[found] ? i : found;
  return found;
}

int ReductionPoints::most_separated() const {
  int found = 0;
  for (int i = 1; i < count_; ++i) found = separation_[i] > separation_[found] ? i : found;
  return found;
}

namespace {

struct Points {
  Float4 x, y, z;
};
Float4 squared_length(const Points& p) { return p.x * p.x + p.y * p.y + p.z * p.z; }
Points from(const Vec3& q, const Points& p) { return {p.x - q.x(), p.y - q.y(), p.z - q.z()}; }
Points perpendicular(const Vec3& unit, const Points& p) {
  return {p.y * unit.z() - p.z * unit.y(), p.z * unit.x() - p.x * unit.z(), p.x * unit.y() - p.y * unit.x()};
}

}  // namespace

template <class Spread>
int ReductionPoints::argmax(Spread spread) const {
  static_assert(kCapacity % kSimd4Width == 0);
  // Floats above 0 compare like their bits. The last few of these tell the place, so that the first of about
  // equal ones wins, without branches that nobody could foretell.
  constexpr std::int32_t kPlace = 127;
  static_assert(kCapacity <= kPlace);
  Int4 found{}, mark = Int4{kPlace, kPlace - 1, kPlace - 2, kPlace - 3};
  for (int i = 0; i < count_; i += kSimd4Width, mark -= kSimd4Width) {
    const Float4 gap = load4(separation_ + i);
    const Float4 gain =
        spread(Points{load4(x_ + i), load4(y_ + i), load4(z_ + i)}) - (gap > 0.0F ? gap : Float4{});
    const Int4 here = gain > 1e-3F ? (as_int_bits(gain) & ~kPlace) | mark : Int4{};
    found = here > found ? here : found;
  }
  const std::int32_t first = horizontal_max(found);
  return first == 0 ? -1 : kPlace - (first & kPlace);
}

int ReductionPoints::select(int (&chosen)[4]) {
  if (count_ == 0) return 0;
  constexpr float kFar = std::numeric_limits<float>::infinity();
  chosen[0] = deepest();
  if (separation_[chosen[0]] == kFar) return 0;
  if (count_ == 1) return 1;
  for (int i = count_; i % kSimd4Width != 0; ++i) set(i, at(0), kFar);
  const Vec3 a = at(chosen[0]);
  chosen[1] = argmax([&](const Points& p) { return sqrt(squared_length(from(a, p))); });
  if (chosen[1] < 0) return 1;
  const Vec3 b = at(chosen[1]);
  const Vec3 along = (b - a) / std::max(1e-6F, (b - a).norm());
  chosen[2] = argmax([&](const Points& p) { return sqrt(squared_length(perpendicular(along, from(a, p)))); });
  if (chosen[2] < 0) return 2;
  const Vec3 c = at(chosen[2]);
  chosen[3] = argmax([&](const Points& p) {
    return sqrt(min(min(squared_length(from(a, p)), squared_length(from(b, p))), squared_length(from(c, p))));
  });
  return chosen[3] < 0 ? 3 : 4;
}

}  // namespace smartsurf::world
