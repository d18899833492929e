#include "smartsurf/world/narrowphase/Gjk.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace smartsurf::world {
namespace {

using scene::ShapeKind;

// Support point of a core in body axes.
Vec3 local_support(const ConvexPart& part, float inset, const Vec3& d) {
  const Shape& s = part.shape;
  auto rim = [&d](float radius, float z) {
    const float across = length_of(d.x(), d.y());
    return across > 1e-12F ? Vec3(d.x() * radius / across, d.y() * radius / across, z) : Vec3(radius, 0, z);
  };
  switch (s.kind) {
    case ShapeKind::kSphere:
      return Vec3::Zero();
    case ShapeKind::kBox:
      return {std::copysign(s.half_extents.x() - inset, d.x()),
              std::copysign(s.half_extents.y() - inset, d.y()),
              std::copysign(s.half_extents.z() - inset, d.z())};
    case ShapeKind::kCylinder:
      return rim(s.radius - inset, std::copysign(s.high - inset, d.z()));
    case ShapeKind::kCapsule:
      return {0, 0, std::copysign(std::max(0.0F, s.high - s.radius), d.z())};
    case ShapeKind::kCone: {
      const float height = s.high - s.low, slant = length_of(height, s.radius);
      const float nr = height / slant, nz = s.radius / slant;
      const Vec3 tip(0, 0, s.high - inset / nz),
          base = rim(s.radius - inset * (1.0F + nz) / nr, s.low + inset);
      return d.dot(tip) > d.dot(base) ? tip : base;
    }
    case ShapeKind::kSolid:
      break;
  }
  return part.hull->inset_corners[part.hull->inset_corner_blocks.argmax(d)];
}

struct Vertex {
  Vec3 w{0, 0, 0}, a{0, 0, 0}, b{0, 0, 0};  // w = a − b
  float weight = 0;
};

struct Simplex {
  Vertex v[4];
  int count = 0;

  Vec3 closest_point() const {
    Vec3 p = Vec3::Zero();
    for (int i = 0; i < count; ++i) p += v[i].weight * v[i].w;
    return p;
  }
  void keep(int i, float weight) {
    v[0] = v[i];
    v[0].weight = weight;
    count = 1;
  }
  // Precondition: i < j.
  void keep(int i, float weight_i, int j, float weight_j) {
    v[0] = v[i];
    v[1] = v[j];
    v[0].weight = weight_i;
    v[1].weight = weight_j;
    count = 2;
  }
};

void reduce_segment(Simplex& s) {
  const Vec3 &a = s.v[0].w, ab = s.v[1].w - a;
  const float t = -a.dot(ab), length = ab.squaredNorm();
  if (t <= 0.0F) return s.keep(0, 1.0F);
  if (!(t < length)) return s.keep(1, 1.0F);
  s.v[1].weight = t / length;
  s.v[0].weight = 1.0F - s.v[1].weight;
}

// Reduces a degenerate triangle to its closest edge.
void reduce_sliver(Simplex& s) {
  Simplex best;
  float min_distance_squared = std::numeric_limits<float>::max();
  for (int i = 0; i < 3; ++i) {
    Simplex edge;
    edge.count = 2;
    edge.v[0] = s.v[i];
    edge.v[1] = s.v[(i + 1) % 3];
    reduce_segment(edge);
    if (const float distance_squared = edge.closest_point().squaredNorm();
        distance_squared < min_distance_squared)
      min_distance_squared = distance_squared, best = edge;
  }
  s = best;
}

// Reduces a triangle to the feature closest to the origin (Ericson 2005, section 5.1.5).
void reduce_triangle(Simplex& s) {
  const Vec3 &a = s.v[0].w, &b = s.v[1].w, &c = s.v[2].w;
  const Vec3 ab = b - a, ac = c - a;
  const float d1 = -ab.dot(a), d2 = -ac.dot(a), d3 = -ab.dot(b), d4 = -ac.dot(b), d5 = -ab.dot(c),
              d6 = -ac.dot(c);
  if (d1 <= 0 && d2 <= 0) return s.keep(0, 1.0F);
  if (d3 >= 0 && d4 <= d3) return s.keep(1, 1.0F);
  if (d6 >= 0 && d5 <= d6) return s.keep(2, 1.0F);
  const float vc = d1 * d4 - d3 * d2, vb = d5 * d2 - d1 * d6, va = d3 * d6 - d5 * d4;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return s.keep(0, 1 - d1 / (d1 - d3), 1, d1 / (d1 - d3));
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return s.keep(0, 1 - d2 / (d2 - d6), 2, d2 / (d2 - d6));
  if (va <= 0 && d4 >= d3 && d5 >= d6) {
    const float t = (d4 - d3) / ((d4 - d3) + (d5 - d6));
    return s.keep(1, 1 - t, 2, t);
  }
  const float sum = va + vb + vc;
  // With rounding, a sliver may match no region; its weights would lie outside [0, 1].
  if (!(va >= 0.0F && vb >= 0.0F && vc >= 0.0F && sum > 0.0F)) return reduce_sliver(s);
  s.v[1].weight = vb / sum;
  s.v[2].weight = vc / sum;
  s.v[0].weight = va / sum;
}

// The face of a tetrahedron that is closest to the origin, of those for which is_inner(height of the origin,
// height of the opposite vertex) is false; without vertices if there is none. Both heights are scaled by
// the same factor.
template <class IsInner>
Simplex closest_face(const Simplex& s, IsInner is_inner) {
  static constexpr int kFaces[4][4] = {{0, 1, 2, 3}, {0, 2, 3, 1}, {0, 3, 1, 2}, {1, 3, 2, 0}};
  Simplex best;
  float min_distance_squared = std::numeric_limits<float>::max();
  for (const auto& f : kFaces) {
    const Vec3 &a = s.v[f[0]].w, &b = s.v[f[1]].w, &c = s.v[f[2]].w, &d = s.v[f[3]].w;
    const Vec3 normal = (b - a).cross(c - a);
    if (is_inner(-normal.dot(a), normal.dot(d - a))) continue;
    Simplex face;
    face.count = 3;
    for (int i = 0; i < 3; ++i) face.v[i] = s.v[f[i]];
    reduce_triangle(face);
    if (const float distance_squared = face.closest_point().squaredNorm();
        distance_squared < min_distance_squared)
      min_distance_squared = distance_squared, best = face;
  }
  return best;
}

// Reduces a tetrahedron to the face closest to the origin. False if the origin is inside.
bool reduce_tetrahedron(Simplex& s) {
  Simplex face = closest_face(s, [](float origin, float vertex) { return origin * vertex > 0.0F; });
  // Rounding decides on which side of each face the vertices of a flat tetrahedron are. Such a tetrahedron
  // has no inside: the origin is higher above a face than the opposite vertex.
  if (face.count == 0)
    face = closest_face(s, [](float origin, float vertex) { return std::abs(origin) <= std::abs(vertex); });
  if (face.count == 0) return false;
  s = face;
  return true;
}

bool reduce(Simplex& s) {
  switch (s.count) {
    case 1:
      s.v[0].weight = 1.0F;
      return true;
    case 2:
      reduce_segment(s);
      return true;
    case 3:
      reduce_triangle(s);
      return true;
    default:
      return reduce_tetrahedron(s);
  }
}

}  // namespace

Vec3 ConvexProxy::support(const Vec3& direction) const {
  return centre + axes * local_support(part, convex_radius, axes.transpose() * direction);
}

Vec3 ConvexProxy::sharp_support(const Vec3& unit_direction) const {
  const bool has_edges = part.shape.kind != ShapeKind::kSphere && part.shape.kind != ShapeKind::kCapsule;
  if (!has_edges) return support_with_radius(unit_direction);
  const Vec3 d = axes.transpose() * unit_direction;
  if (part.hull) return centre + axes * part.hull->hull->vertices[part.hull->corner_blocks.argmax(d)];
  return centre + axes * local_support(part, 0.0F, d);
}

namespace {

Vertex make_vertex(const ConvexProxy& a, const ConvexProxy& b, const Vec3& towards_a) {
  Vertex v;
  v.a = a.support(-towards_a);
  v.b = b.support(towards_a);
  v.w = v.a - v.b;
  return v;
}

Simplex restore_simplex(const ConvexProxy& a, const ConvexProxy& b, const SimplexCache& cache) {
  Simplex s;
  for (s.count = 0; s.count < cache.count; ++s.count) {
    Vertex& v = s.v[s.count];
    v.a = a.centre + a.axes * cache.on_a[s.count];
    v.b = b.centre + b.axes * cache.on_b[s.count];
    v.w = v.a - v.b;
  }
  return s;
}

void store_simplex(const ConvexProxy& a, const ConvexProxy& b, const Simplex& s, SimplexCache& out) {
  out.count = s.count;
  for (int i = 0; i < s.count; ++i) {
    out.on_a[i] = a.axes.transpose() * (s.v[i].a - a.centre);
    out.on_b[i] = b.axes.transpose() * (s.v[i].b - b.centre);
  }
}

// `error`: of the distance, relative or in u, whichever is greater, unless it converged.
ClosestPoints search(const ConvexProxy& a, const ConvexProxy& b, float limit, const Vec3& towards_a,
                     SimplexCache* cache, float& error) {
  constexpr int kMaxIterations = 20;
  // kTolerance applies to the distance, relative or in u, whichever is greater.
  constexpr float kOverlapSquared = 1e-10F, kTolerance = 1e-4F;
  const ClosestPoints overlap{Vec3::Zero(), Vec3::Zero(), Vec3(0, 0, 1), 0.0F, false};
  Simplex s;
  error = 0.0F;
  Vec3 closest = towards_a;
  if (cache && cache->count > 0) {
    s = restore_simplex(a, b, *cache);
    reduce(s);
    closest = s.closest_point();
    cache->count = 0;
    if (closest.squaredNorm() < kOverlapSquared) return overlap;
  }
  if (closest.squaredNorm() < kOverlapSquared) closest = Vec3(0, 0, 1);
  bool converged = false;
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    const Vertex v = make_vertex(a, b, closest);
    const float closest_squared = closest.squaredNorm(), length = std::sqrt(closest_squared),
                projection = closest.dot(v.w);
    if (projection > limit * length)
      return {Vec3::Zero(), Vec3::Zero(), closest / length, projection / length, true};
    // Converged: the new support point is not significantly closer to the origin.
    if (s.count > 0 && closest_squared - projection <= kTolerance * (closest_squared + length)) {
      converged = true;
      break;
    }
    s.v[s.count++] = v;
    if (!reduce(s)) return overlap;
    closest = s.closest_point();
    if (closest.squaredNorm() < kOverlapSquared) return overlap;
  }
  if (cache) store_simplex(a, b, s, *cache);
  ClosestPoints out{Vec3::Zero(), Vec3::Zero(), Vec3(0, 0, 1), closest.norm(), true};
  out.normal = closest / out.distance;
  for (int i = 0; i < s.count; ++i) {
    out.on_a += s.v[i].weight * s.v[i].a;
    out.on_b += s.v[i].weight * s.v[i].b;
  }
  if (!converged)
    error = (out.distance - out.normal.dot(make_vertex(a, b, out.normal).w)) / (1.0F + out.distance);
  return out;
}

}  // namespace

// Among nearly flat simplices rounding decides, and a search may go in circles: then it begins elsewhere.
ClosestPoints closest_points(const ConvexProxy& a, const ConvexProxy& b, float limit, const Vec3& towards_a,
                             SimplexCache* cache) {
  constexpr float kMaxError = 5e-4F;
  float error;
  ClosestPoints best = search(a, b, limit, towards_a, cache, error);
  if (!(error > kMaxError)) return best;
  if (cache) cache->count = 0;
  for (int k = 0; k < 12 && error > kMaxError; ++k) {
    const Vec3 direction = (k & 1 ? -1.0F : 1.0F) * (k < 6 ? a : b).axes.col(k / 2 % 3);
    float other_error;
    const ClosestPoints other = search(a, b, limit, direction, nullptr, other_error);
    if (other.separated && other_error < error) best = other, error = other_error;
  }
  if (error > kMaxError) best.distance = std::max(0.0F, best.distance - error * (1.0F + best.distance));
  return best;
}

}  // namespace smartsurf::world
