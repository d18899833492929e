#include "smartsurf/world/narrowphase/SeamCorrection.h"

#include <algorithm>
#include <vector>

#include "smartsurf/world/narrowphase/InternalEdges.h"

namespace smartsurf::world {
namespace {

// A body slides on others at a relative speed above kSliding, u/s. Those others move together if their
// relative speed is below kTogether, or below kTogetherShare of the sliding speed.
constexpr float kSliding = 0.05F, kTogether = 0.05F, kTogetherShare = 0.1F;
constexpr float kUnusedSeparation = 1e6F;  // u: exerts no impulse

Vec3 velocity_at(const BodyStore& bodies, std::size_t i, const Vec3& point) {
  if (!bodies.is_active(i)) return Vec3::Zero();
  return bodies.velocity(i) + bodies.angular_velocity(i).cross(point - bodies.position[i]);
}

// A contact as that of body a with another, whichever of the two the list calls a. The point of a sphere is
// on it.
Contact seen_from(const BodyStore& bodies, std::int32_t body, const Manifold& m, const Contact& c) {
  if (m.a == body) return c;
  Contact own = c;
  own.normal = -c.normal;
  own.anchor = bodies.position[m.a] + c.anchor - bodies.position[m.b];
  if (bodies.is_sphere[body]) own.anchor -= c.separation * c.normal;
  return own;
}
void set_from(const BodyStore& bodies, std::int32_t body, const Manifold& m, const Contact& own, Contact& c) {
  if (own.separation == kSpareSeparation) {
    c.separation = kUnusedSeparation;
    c.normal_impulse = 0.0F;
    c.friction_impulse = c.rolling_impulse = Vec3::Zero();
    return;
  }
  const bool is_a = m.a == body;
  c.separation = own.separation;
  c.normal = is_a ? own.normal : Vec3(-own.normal);
  c.anchor = own.anchor;
  if (is_a) return;
  c.anchor += bodies.position[m.b] - bodies.position[m.a];
  if (bodies.is_sphere[body]) c.anchor += c.separation * c.normal;
}

struct Neighbour {
  std::int32_t manifold, other, next;  // `other`: the other body of the manifold
};

bool has_faces(const BodyStore& bodies, std::size_t i) { return !bodies.is_round(i); }

// The manifolds of each body with others that move, and, if any body is fixed, that with all that does not.
class Neighbours {
 public:
  void find(const BodyStore& bodies, const ContactList& pairs, const ContactList& statics) {
    neighbours_.clear();
    first_.assign(bodies.size(), -1);
    for (std::int32_t i = 0; i < std::ssize(pairs.manifolds); ++i) {
      const auto add = [&](std::int32_t body, std::int32_t other) {
        neighbours_.push_back({i, other, first_[body]});
        first_[body] = static_cast<std::int32_t>(neighbours_.size()) - 1;
      };
      const Manifold& m = pairs.manifolds[i];
      add(m.a, m.b), add(m.b, m.a);
    }
    has_fixed_ = std::ranges::find(bodies.mass, 0.0F) != bodies.mass.end();
    if (!has_fixed_) return;
    static_.assign(bodies.size(), -1);
    for (std::int32_t i = 0; i < std::ssize(statics.manifolds); ++i) static_[statics.manifolds[i].a] = i;
  }
  bool has_several(std::size_t body) const {
    return first_[body] >= 0 && (neighbours_[first_[body]].next >= 0 || static_of(body) >= 0);
  }
  // −1: none.
  std::int32_t static_of(std::size_t body) const { return has_fixed_ ? static_[body] : -1; }
  // Calls visit(manifold, other body) in descending order.
  template <class Visit>
  void for_each(std::size_t body, Visit visit) const {
    any_of(body, [&](const Neighbour& n) {
      visit(n.manifold, n.other);
      return false;
    });
  }
  // Calls is(neighbour) until it returns true.
  template <class Is>
  bool any_of(std::size_t body, Is is) const {
    for (std::int32_t k = first_[body]; k >= 0; k = neighbours_[k].next)
      if (is(neighbours_[k])) return true;
    return false;
  }

 private:
  std::vector<std::int32_t> first_, static_;
  std::vector<Neighbour> neighbours_;
  bool has_fixed_ = false;
};

// The contacts of a body with another one that has faces.
struct Touched {
  std::int32_t other;
  const Manifold* manifold;
  std::span<Contact> contacts;
  Vec3 origin;
  float reach_squared;  // of the points around the origin at which it may continue a face, u²
  bool is_under = false;

  bool reaches(const Vec3& point) const { return (point - origin).squaredNorm() <= reach_squared; }
};

// Appends them in the order of the bodies that move, then for each fixed body.
void find_touched(const BodyStore& bodies, std::int32_t body, const Neighbours& neighbours,
                  ContactList& pairs, ContactList& statics, std::vector<Touched>& out) {
  const auto add = [&](std::int32_t other, const Manifold& m, std::span<Contact> contacts) {
    constexpr float kRounding = 1e-3F;  // u
    const float reach = greatest_continued_distance(*bodies.shape[other]) + kRounding;
    out.push_back({other, &m, contacts, bodies.origin(other), reach * reach});
  };
  out.clear();
  neighbours.for_each(body, [&](std::int32_t k, std::int32_t other) {
    const Manifold& m = pairs.manifolds[k];
    if (has_faces(bodies, other)) add(other, m, pairs.contacts_of(m));
  });
  std::reverse(out.begin(), out.end());
  if (neighbours.static_of(body) < 0) return;
  const Manifold& m = statics.manifolds[neighbours.static_of(body)];
  const std::span<Contact> contacts = statics.contacts_of(m);
  for (std::size_t from = 0, to = 0; from < contacts.size(); from = to) {
    const Partner partner = contacts[from].partner;
    while (to < contacts.size() && contacts[to].partner == partner) ++to;
    const std::int32_t other = other_body(m, contacts[from]);
    if (other >= 0 && has_faces(bodies, other)) add(other, m, contacts.subspan(from, to - from));
  }
}

// True if a face of the other body may continue one at the point.
bool may_continue(const BodyStore& bodies, std::size_t other, const Vec3& point) {
  return may_continue(*bodies.shape[other], bodies.axes[other].transpose() * (point - bodies.origin(other)));
}

// False if the body slides at no point of the pair, as the motion of the two bodies tells without a look at
// their contacts: most bodies are at rest.
bool may_slide(const BodyStore& bodies, std::int32_t body, std::int32_t other) {
  Vec3 relative = bodies.velocity(body);
  float turning = 0.0F;
  if (bodies.is_active(other)) {
    // Points that either body may have are well within this of the other's centre of mass, u.
    const float reach = 2.0F * ((bodies.position[body] - bodies.position[other]).norm() +
                                bodies.bounding_radius[body] + bodies.bounding_radius[other]);
    relative -= bodies.velocity(other);
    turning = reach * bodies.angular_velocity(other).norm();
  }
  return relative.norm() + turning >= kSliding;
}

// A contact of a body, and what it becomes.
struct Corrected {
  std::int32_t body, other;
  Contact* contact;
  Contact value;
};

}  // namespace

// Bodies are corrected in ascending order, because those on either side of a contact may change it. Several
// members find what changes for each body as if it were the first; where an earlier one has changed its
// contacts, that is found again.
struct SeamCorrection::Shared {
  Neighbours neighbours;
  std::vector<std::vector<Corrected>> of_members;
  std::vector<Corrected> all, again;
  std::vector<std::uint8_t> has_changed;  // by body: contacts, by the correction of another

  static void find(const BodyStore&, ContactList& pairs, ContactList& statics, const Neighbours&,
                   std::int32_t body, std::vector<Corrected>&);
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
  const bool are_found = member.member_count > 1;
  if (are_found) {
    std::vector<Corrected>& own = s.of_members[member.index];
    for (const std::int32_t i : own_bodies) Shared::find(bodies, pairs, statics, s.neighbours, i, own);
  }
  member.single([&] { s.apply_in_order(bodies, pairs, statics, are_found); });
}

void SeamCorrection::Shared::begin(const BodyStore& bodies, const ContactList& pairs,
                                   const ContactList& statics, const Member& member) {
  of_members.resize(member.member_count);
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
  has_changed.assign(bodies.size(), 0);
  std::size_t next = 0;
  for (std::int32_t i = 0; i < bodies.size(); ++i) {
    const std::size_t first = next;
    while (next < all.size() && all[next].body == i) ++next;
    if (are_found && has_changed[i] == 0) {
      apply(std::span(all).subspan(first, next - first));
    } else {
      again.clear();
      find(bodies, pairs, statics, neighbours, i, again);
      apply(again);
    }
  }
}

// Appends the contacts of the body that change.
void SeamCorrection::Shared::find(const BodyStore& bodies, ContactList& pairs, ContactList& statics,
                                  const Neighbours& neighbours, std::int32_t i, std::vector<Corrected>& out) {
  thread_local std::vector<Touched> touched;
  thread_local std::vector<Contact> own;
  thread_local std::vector<SeamContact> seam;
  thread_local std::vector<Solid> solids;
  if (!bodies.is_active(i) || !neighbours.has_several(i)) return;
  // Two at least with faces are needed, of which any number may be fixed.
  int faced = neighbours.static_of(i) >= 0 ? 2 : 0;
  const auto is_second = [&](const Neighbour& n) { return has_faces(bodies, n.other) && ++faced == 2; };
  if (faced == 0 && !neighbours.any_of(i, is_second)) return;
  const bool slides_on_fixed = neighbours.static_of(i) >= 0 && bodies.velocity(i).norm() >= kSliding;
  if (!slides_on_fixed &&
      !neighbours.any_of(i, [&](const Neighbour& n) { return may_slide(bodies, i, n.other); }))
    return;
  find_touched(bodies, i, neighbours, pairs, statics, touched);
  if (touched.size() < 2) return;
  for (Touched& one : touched)
    for (const Contact& c : one.contacts) {
      const Vec3 point = bodies.position[one.manifold->a] + c.anchor;
      // The contact's point may be on the body, as far away as it travels in a step.
      const bool is_of_body = one.manifold->a == i;
      const Vec3 on_other = is_of_body ? Vec3(point - c.separation * c.normal) : point;
      const auto is_candidate = [&](const Touched& next) {
        if (next.other == one.other || (one.is_under && next.is_under)) return false;
        // Fixed bodies have been corrected among each other.
        if (bodies.is_static(one.other) && bodies.is_static(next.other)) return false;
        return next.reaches(point) || (is_of_body && next.reaches(on_other));
      };
      if (std::ranges::none_of(touched, is_candidate)) continue;
      const Vec3 velocity = velocity_at(bodies, one.other, point);
      const float sliding = (bodies.velocity(i) - velocity).norm();
      if (sliding < kSliding) continue;
      const float together = std::max(kTogether, kTogetherShare * sliding);
      for (Touched& next : touched) {
        if (!is_candidate(next)) continue;
        // The body slides over both if these move together at the point.
        if ((velocity_at(bodies, next.other, point) - velocity).norm() >= together) continue;
        if (may_continue(bodies, next.other, point) ||
            (is_of_body && may_continue(bodies, next.other, on_other)))
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
  for (Contact& c : own) seam.push_back({&c, bodies.position[i], bodies.origin(i)});
  mark_internal_edges(solids, true, *bodies.shape[i], bodies.axes[i], seam);
  std::size_t next = 0;
  for (const Touched& t : touched)
    for (Contact& c : t.contacts) {
      out.push_back({i, t.other, &c, c});
      set_from(bodies, i, *t.manifold, own[next++], out.back().value);
    }
}

}  // namespace smartsurf::world
