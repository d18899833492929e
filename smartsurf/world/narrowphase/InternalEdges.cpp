#include "smartsurf/world/narrowphase/InternalEdges.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "smartsurf/world/narrowphase/Distance.h"

namespace smartsurf::world {
namespace {

constexpr float kMarked = std::numeric_limits<float>::infinity();
constexpr float kLevel = 3e-3F;         // faces are level up to this, u
constexpr float kGap = 1e-3F;           // and continue each other across gaps up to this, u
constexpr float kMinCosine = 0.99999F;  // between the normals of level faces
constexpr float kMinTilt =
    3e-4F;  // sine of the angle between face and contact normal of a contact at an edge
// Beyond the edge the other part is looked for at the first of these distances that is clear of the part, u.
constexpr float kProbes[] = {5e-3F, 0.02F, 0.05F};
constexpr float kClear = 2e-3F;
constexpr float kSameNormal = 0.99F;  // cosine

struct Plane {
  Vec3 normal, point;
};

// Calls visit(normal, offset) for the faces, in body axes.
template <class Visit>
void for_each_face(const ConvexPart& part, Visit visit) {
  if (part.hull != nullptr)
    for (const auto& face : part.hull->hull->faces) visit(face.normal, face.offset);
  else if (part.shape.kind == scene::ShapeKind::kBox)
    for (int axis = 0; axis < 3; ++axis)
      for (const float sign : {1.0F, -1.0F})
        visit(Vec3(sign * Vec3::Unit(axis)), part.shape.half_extents[axis]);
}

// A contact point is at an edge of a face if it is this close to its plane, u: bodies overlap a little, and
// round off each other's edges by their convex radius.
constexpr float kLeastEdgeDepth = 0.02F;
float edge_depth(const ConvexPart& part) {
  constexpr float kAllowance = 0.005F;
  const float radius = part.hull != nullptr ? part.hull->convex_radius : part.shape.convex_radius;
  return std::max(kLeastEdgeDepth, kAllowance + radius);
}

bool is_near(const ConvexPart& part, const Vec3& local, float reach) {
  if (part.hull == nullptr) return (local.cwiseAbs() - part.shape.half_extents).maxCoeff() <= reach;
  const scene::ConvexHull& hull = *part.hull->hull;
  return (hull.bounds_min - local).cwiseMax(local - hull.bounds_max).maxCoeff() <= reach;
}

bool are_same(const ConvexPart& a, const ConvexPart& b) { return &a.shape == &b.shape && a.hull == b.hull; }

template <class Visit>
void for_each_solid_part(std::span<const Solid> solids, Visit visit) {
  for (std::size_t i = 0; i < solids.size(); ++i)
    for_each_part(solids[i].shape, [&](const ConvexPart& part) { visit(i, part); });
}

// True if another part has a face in the plane at its point.
bool is_continued(std::span<const Solid> solids, std::size_t own_solid, const ConvexPart& own_part,
                  const Plane& plane) {
  bool found = false;
  for_each_solid_part(solids, [&](std::size_t i, const ConvexPart& part) {
    if (found || (i == own_solid && are_same(part, own_part))) return;
    const Solid& solid = solids[i];
    const Vec3 local = solid.axes.transpose() * (plane.point - solid.centre);
    if (!is_near(part, local, kLevel)) return;
    const Vec3 normal = solid.axes.transpose() * plane.normal;
    for_each_face(part, [&](const Vec3& face, float offset) {
      if (found || face.dot(normal) <= kMinCosine) return;
      const float height = face.dot(local) - offset;
      found = std::abs(height) <= kLevel && signed_distance(part, local - height * face, kGap).distance <= kGap;
    });
  });
  return found;
}

// The plane in which a contact at `point`, with the unit normal out of the solids, lies; none if it is no
// internal edge. Of several, that nearest to the contact's normal, or to its point.
std::optional<Plane> plane_of(std::span<const Solid> solids, const Vec3& point, const Vec3& normal) {
  constexpr float kSameCosine = 1e-4F;
  std::optional<Plane> found;
  float best_cosine = 0.0F, best_distance = 0.0F;
  for_each_solid_part(solids, [&](std::size_t i, const ConvexPart& part) {
    const Solid& solid = solids[i];
    const Vec3 local = solid.axes.transpose() * (point - solid.centre),
               direction = solid.axes.transpose() * normal;
    const float depth = edge_depth(part);
    if (!is_near(part, local, depth)) return;
    for_each_face(part, [&](const Vec3& face, float offset) {
      const float height = face.dot(local) - offset, cosine = face.dot(direction), distance = std::abs(height);
      if (distance > depth || cosine < -kMinTilt) return;
      if (found && (cosine < best_cosine - kSameCosine ||
                    (cosine <= best_cosine + kSameCosine && distance >= best_distance)))
        return;
      const Vec3 tangent = direction - cosine * face;
      const float tilt = tangent.norm();
      if (tilt < kMinTilt) return;
      const Vec3 foot = local - height * face, outward = tangent / tilt;
      for (const float probe : kProbes) {
        const Vec3 beyond = foot + probe * outward;
        if (signed_distance(part, beyond).distance < kClear) continue;
        const Plane plane{solid.axes * face, solid.centre + solid.axes * beyond};
        if (is_continued(solids, i, part, plane)) found = plane, best_cosine = cosine, best_distance = distance;
        break;
      }
    });
  });
  return found;
}

}  // namespace

bool may_have_internal_edges(std::span<const Solid> solids) {
  return solids.size() > 1 || (solids.size() == 1 && solids[0].shape.hulls.size() > 1);
}

void mark_internal_edges(std::span<const Solid> solids, bool are_b, float sphere_radius,
                         std::span<const SeamContact> contacts) {
  // Normals and heights are those of the solids' side.
  const float side = are_b ? 1.0F : -1.0F;
  const bool is_sphere = sphere_radius > 0.0F;
  thread_local std::vector<std::optional<Plane>> planes;
  planes.clear();
  bool any = false;
  // The point of a sphere's contact is on body a. That of other shapes is anywhere between the surfaces.
  const float share = !is_sphere ? 0.5F : are_b ? 1.0F : 0.0F;
  const auto point_on_solid = [&](const SeamContact& s, float of_separation) -> Vec3 {
    return s.origin + s.contact->anchor - side * of_separation * s.contact->separation * s.contact->normal;
  };
  for (const SeamContact& s : contacts) {
    const Vec3 normal = side * s.contact->normal;
    std::optional<Plane> plane = plane_of(solids, point_on_solid(s, share), normal);
    if (!is_sphere && s.contact->separation > kLeastEdgeDepth)
      for (const float other : {0.0F, 1.0F})
        if (!plane) plane = plane_of(solids, point_on_solid(s, other), normal);
    any |= plane.has_value();
    planes.push_back(plane);
  }
  if (!any) return;
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    if (!planes[i]) continue;
    Contact& c = *contacts[i].contact;
    const Vec3& normal = planes[i]->normal;
    const auto has_normal = [&](std::size_t k) {
      const Contact& other = *contacts[k].contact;
      return (k < i || !planes[k]) && other.separation != kMarked &&
             side * other.normal.dot(normal) > kSameNormal;
    };
    // A flat body bears on such points as well; a sphere has one in a plane.
    bool is_spare = false;
    const bool may_bear = !is_sphere && side * c.normal.dot(normal) > kSameNormal;
    for (std::size_t k = 0; k < contacts.size() && !is_spare && !may_bear; ++k)
      is_spare = k != i && has_normal(k);
    if (is_spare) {
      c.separation = kMarked;
      continue;
    }
    const Vec3 old_normal = side * c.normal;
    const Vec3 on_body = point_on_solid(contacts[i], share) + c.separation * old_normal +
                         sphere_radius * (old_normal - normal);
    c.normal = side * normal;
    c.separation = normal.dot(on_body - planes[i]->point);
    c.anchor = on_body - contacts[i].origin;
    if (!is_sphere || !are_b) c.anchor -= (is_sphere ? 1.0F : 0.5F) * c.separation * normal;
  }
}

bool correct_internal_edges(const Solid& a, const Solid& b, std::vector<Contact>& contacts,
                            std::size_t first) {
  if (a.shape.hulls.size() < 2 && b.shape.hulls.size() < 2) return false;
  const std::size_t count = contacts.size();
  thread_local std::vector<SeamContact> seam;
  for (const Solid* solid : {&b, &a}) {
    const Shape& other = solid == &b ? a.shape : b.shape;
    if (solid->shape.hulls.size() < 2 || contacts.size() == first) continue;
    seam.clear();
    for (std::size_t k = first; k < contacts.size(); ++k) seam.push_back({&contacts[k], a.centre});
    mark_internal_edges({solid, 1}, solid == &b, other.is_sphere() ? other.bounding_radius : 0.0F, seam);
    erase_marked(contacts, first);
  }
  return contacts.size() < count;
}

namespace {

// A body matters to what lies on others if it moves against them by more than this, u/s; they move together
// if they do so by less than kTogether and this share of it.
constexpr float kSliding = 0.05F, kTogether = 0.05F, kTogetherShare = 0.1F;
constexpr float kUnusedSeparation = 1e6F;  // u: exerts no impulse

Vec3 velocity_at(const BodyStore& bodies, std::size_t i, const Vec3& point) {
  if (!bodies.is_active(i)) return Vec3::Zero();
  return bodies.velocity(i) + bodies.angular_velocity(i).cross(point - bodies.position[i]);
}

// A contact as that of body a with another, whichever of the two the list calls a. The point of a sphere is
// on it.
Contact seen_from(const BodyStore& bodies, std::size_t body, const Manifold& m, const Contact& c) {
  if (static_cast<std::size_t>(m.a) == body) return c;
  Contact own = c;
  own.normal = -c.normal;
  own.anchor = bodies.position[m.a] + c.anchor - bodies.position[m.b];
  if (bodies.is_sphere[body]) own.anchor -= c.separation * c.normal;
  return own;
}
void set_from(const BodyStore& bodies, std::size_t body, const Manifold& m, const Contact& own, Contact& c) {
  if (own.separation == kMarked) {
    c.separation = kUnusedSeparation;
    c.normal_impulse = 0.0F;
    c.friction_impulse = c.rolling_impulse = Vec3::Zero();
    return;
  }
  const bool is_a = static_cast<std::size_t>(m.a) == body;
  c.separation = own.separation;
  c.normal = is_a ? own.normal : Vec3(-own.normal);
  c.anchor = own.anchor;
  if (is_a) return;
  c.anchor += bodies.position[m.b] - bodies.position[m.a];
  if (bodies.is_sphere[body]) c.anchor += c.separation * c.normal;
}

struct Neighbour {
  std::int32_t manifold, next;
};

// The manifolds of each body with others that move, and, if any body is fixed, that with all that does not.
class Neighbours {
 public:
  void find(const BodyStore& bodies, const ContactList& pairs, const ContactList& statics) {
    neighbours_.clear();
    first_.assign(static_cast<std::size_t>(bodies.size()), -1);
    for (std::int32_t i = 0; i < std::ssize(pairs.manifolds); ++i)
      for (const std::int32_t body : {pairs.manifolds[i].a, pairs.manifolds[i].b}) {
        neighbours_.push_back({i, first_[body]});
        first_[body] = static_cast<std::int32_t>(neighbours_.size()) - 1;
      }
    has_fixed_ = std::ranges::find(bodies.mass, 0.0F) != bodies.mass.end();
    if (!has_fixed_) return;
    static_.assign(static_cast<std::size_t>(bodies.size()), -1);
    for (std::int32_t i = 0; i < std::ssize(statics.manifolds); ++i) static_[statics.manifolds[i].a] = i;
  }
  bool has_several(std::size_t body) const {
    return first_[body] >= 0 && (neighbours_[first_[body]].next >= 0 || static_of(body) >= 0);
  }
  // −1: none.
  std::int32_t static_of(std::size_t body) const { return has_fixed_ ? static_[body] : -1; }
  // In descending order.
  template <class Visit>
  void for_each(std::size_t body, Visit visit) const {
    for (std::int32_t k = first_[body]; k >= 0; k = neighbours_[k].next) visit(neighbours_[k].manifold);
  }

 private:
  std::vector<std::int32_t> first_, static_;
  std::vector<Neighbour> neighbours_;
  bool has_fixed_ = false;
};

// The contacts of a body with another one that has faces.
struct Touched {
  std::size_t other;
  const Manifold* manifold;
  std::span<Contact> contacts;
  bool is_under = false;
};

// Appends them in the order of the bodies that move, then for each fixed body.
void find_touched(const BodyStore& bodies, std::size_t body, const Neighbours& neighbours, ContactList& pairs,
                  ContactList& statics, std::vector<Touched>& out) {
  const auto has_faces = [&](std::size_t other) {
    const Shape& s = *bodies.shape[other];
    return !s.hulls.empty() || s.kind == scene::ShapeKind::kBox;
  };
  out.clear();
  neighbours.for_each(body, [&](std::int32_t k) {
    const Manifold& m = pairs.manifolds[k];
    const auto other = static_cast<std::size_t>(static_cast<std::size_t>(m.a) == body ? m.b : m.a);
    if (has_faces(other)) out.push_back({other, &m, pairs.contacts_of(m)});
  });
  std::ranges::reverse(out);
  if (neighbours.static_of(body) < 0) return;
  const Manifold& m = statics.manifolds[neighbours.static_of(body)];
  const std::span<Contact> contacts = statics.contacts_of(m);
  for (std::size_t from = 0, to = 0; from < contacts.size(); from = to) {
    const Partner partner = contacts[from].partner;
    while (to < contacts.size() && contacts[to].partner == partner) ++to;
    if (partner >= Partner{} && has_faces(static_cast<std::size_t>(partner)))
      out.push_back({static_cast<std::size_t>(partner), &m, contacts.subspan(from, to - from)});
  }
}

// Whether a face of the other body may continue one at the point.
bool may_continue(const BodyStore& bodies, std::size_t other, const Vec3& point) {
  const Vec3 local = bodies.axes[other].transpose() * (point - bodies.origin(other));
  bool found = false;
  for_each_part(*bodies.shape[other], [&](const ConvexPart& part) {
    found = found || is_near(part, local, kProbes[2] + edge_depth(part));
  });
  return found;
}

// A contact of a body, and what it becomes.
struct Corrected {
  std::size_t body, other;
  Contact* contact;
  Contact value;
};

}  // namespace

// Bodies are corrected in ascending order, because those on either side of a contact may change it. Several members
// find what changes for each body as if it were the first; where an earlier one has changed its contacts, that is found
// again.
struct SeamCorrection::Shared {
  bool applies = false;
  Neighbours neighbours;
  std::vector<std::vector<Corrected>> of_members;
  std::vector<Corrected> all, again;
  std::vector<std::uint8_t> has_changed;  // by body: contacts, by the correction of another

  static void find(const BodyStore&, ContactList& pairs, ContactList& statics, const Neighbours&, std::size_t body,
                   std::vector<Corrected>&);
  void begin(const BodyStore&, const ContactList& pairs, const ContactList& statics, const Member&);
  void apply(std::span<const Corrected>);
  void apply_in_order(const BodyStore&, ContactList& pairs, ContactList& statics, bool are_found);
};

SeamCorrection::SeamCorrection() : shared_(std::make_unique<Shared>()) {}
SeamCorrection::~SeamCorrection() = default;

void SeamCorrection::run(const BodyStore& bodies, ContactList& pairs, ContactList& statics,
                         std::span<const std::int32_t> own_bodies, const Member& member) {
  Shared& s = *shared_;
  member.single([&] { s.begin(bodies, pairs, statics, member); });
  if (!s.applies) return;
  const bool are_found = member.member_count > 1;
  if (are_found) {
    std::vector<Corrected>& own = s.of_members[static_cast<std::size_t>(member.index)];
    for (const std::int32_t i : own_bodies)
      Shared::find(bodies, pairs, statics, s.neighbours, static_cast<std::size_t>(i), own);
  }
  member.single([&] { s.apply_in_order(bodies, pairs, statics, are_found); });
}

void SeamCorrection::Shared::begin(const BodyStore& bodies, const ContactList& pairs, const ContactList& statics,
                                   const Member& member) {
  // Spheres have no faces: scenes of spheres alone pay for no neighbours.
  const auto has_flat_body = [&](const Manifold& m) { return !bodies.is_sphere[m.a] || !bodies.is_sphere[m.b]; };
  applies = std::ranges::any_of(pairs.manifolds, has_flat_body);
  if (!applies) return;
  of_members.resize(static_cast<std::size_t>(member.member_count));
  for (std::vector<Corrected>& found : of_members) found.clear();
  neighbours.find(bodies, pairs, statics);
}

void SeamCorrection::Shared::apply(std::span<const Corrected> corrected) {
  for (const Corrected& c : corrected) {
    if (c.contact->separation != c.value.separation || c.contact->normal != c.value.normal ||
        c.contact->anchor != c.value.anchor)
      has_changed[c.other] = 1;
    *c.contact = c.value;
  }
}

void SeamCorrection::Shared::apply_in_order(const BodyStore& bodies, ContactList& pairs, ContactList& statics,
                                            bool are_found) {
  all.clear();
  for (const std::vector<Corrected>& found : of_members) all.insert(all.end(), found.begin(), found.end());
  if (are_found && all.empty()) return;
  std::ranges::sort(all, {}, &Corrected::body);
  has_changed.assign(static_cast<std::size_t>(bodies.size()), 0);
  auto next = all.begin();
  for (std::size_t i = 0; i < has_changed.size(); ++i) {
    const auto first = next;
    while (next != all.end() && next->body == i) ++next;
    if (are_found && has_changed[i] == 0) {
      apply({first, next});
    } else {
      again.clear();
      find(bodies, pairs, statics, neighbours, i, again);
      apply(again);
    }
  }
}

// Appends the contacts of the body that change.
void SeamCorrection::Shared::find(const BodyStore& bodies, ContactList& pairs, ContactList& statics,
                                  const Neighbours& neighbours, std::size_t i, std::vector<Corrected>& out) {
  thread_local std::vector<Touched> touched;
  thread_local std::vector<Contact> own;
  thread_local std::vector<SeamContact> seam;
  thread_local std::vector<Solid> solids;
  if (!bodies.is_active(i) || !neighbours.has_several(i)) return;
  find_touched(bodies, i, neighbours, pairs, statics, touched);
  if (touched.size() < 2) return;
  for (Touched& one : touched)
    for (const Contact& c : one.contacts) {
      const Vec3 point = bodies.position[one.manifold->a] + c.anchor, speed = velocity_at(bodies, one.other, point);
      // The contact's point may be on the body, as far away as it travels in a step.
      const bool is_of_body = static_cast<std::size_t>(one.manifold->a) == i;
      const Vec3 on_other = is_of_body ? Vec3(point - c.separation * c.normal) : point;
      const float sliding = (velocity_at(bodies, i, bodies.position[i]) - speed).norm();
      if (sliding < kSliding) continue;
      for (Touched& next : touched) {
        // Fixed bodies have been corrected among each other.
        const bool are_fixed = bodies.is_static(one.other) && bodies.is_static(next.other);
        if (next.other == one.other || are_fixed) continue;
        if (!may_continue(bodies, next.other, point) && !may_continue(bodies, next.other, on_other)) continue;
        if ((velocity_at(bodies, next.other, point) - speed).norm() < std::max(kTogether, kTogetherShare * sliding))
          one.is_under = next.is_under = true;
      }
    }
  std::erase_if(touched, [](const Touched& t) { return !t.is_under; });
  if (touched.size() < 2) return;
  solids.clear(), own.clear(), seam.clear();
  for (const Touched& t : touched) {
    solids.push_back({*bodies.shape[t.other], bodies.origin(t.other), bodies.axes[t.other]});
    for (const Contact& c : t.contacts) own.push_back(seen_from(bodies, i, *t.manifold, c));
  }
  for (Contact& c : own) seam.push_back({&c, bodies.position[i]});
  mark_internal_edges(solids, true, bodies.is_sphere[i] ? bodies.bounding_radius[i] : 0.0F, seam);
  std::size_t next = 0;
  for (const Touched& t : touched)
    for (Contact& c : t.contacts) {
      out.push_back({i, t.other, &c, c});
      set_from(bodies, i, *t.manifold, own[next++], out.back().value);
    }
}

void erase_marked(std::vector<Contact>& contacts, std::size_t first) {
  const auto marked = std::remove_if(contacts.begin() + static_cast<std::ptrdiff_t>(first), contacts.end(),
                                     [](const Contact& c) { return c.separation == kMarked; });
  contacts.erase(marked, contacts.end());
}

}  // namespace smartsurf::world
