// The narrow phase: the contacts of one slab's bodies with the field, the ground, static bodies and each
// other.
#include <algorithm>
#include <cmath>
#include <span>

#include "smartsurf/world/CollisionPipeline.h"
#include "smartsurf/world/field/ConvexOnField.h"
#include "smartsurf/world/narrowphase/ContactMatching.h"
#include "smartsurf/world/narrowphase/InternalEdges.h"
#include "smartsurf/world/narrowphase/PairContacts.h"
#include "smartsurf/world/narrowphase/PairSweep.h"
#include "smartsurf/world/narrowphase/RollingPoints.h"

namespace smartsurf::world {
namespace {

// More pairs touch than a slab may hold. Thrown, so that none of the others is looked for.
struct Overloaded {};

// Collision detection measures from the origin of the shape.
void anchor_at_centre_of_mass(const BodyStore& bodies, std::size_t i, std::span<Contact> contacts) {
  if (!bodies.has_offsets) return;
  const Vec3& offset = bodies.origin_offset[i];
  if (offset.isZero(0.0F)) return;
  for (Contact& c : contacts) c.anchor += offset;
}

// The solver moves a body's points on straight paths, which leave its bounding sphere where it turns far in a
// step. Drops the contacts from `first` on, with cells or the ground, that the sphere and a margin, u, do not
// reach in the step. Anchors are from the origin of the shape.
void drop_out_of_reach(const BodyStore& bodies, std::size_t i, float dt_s, float margin, std::size_t first,
                       std::vector<Contact>& contacts) {
  constexpr float kFarTurn_rad = 0.25F;
  if (bodies.is_sphere[i] || bodies.angular_velocity(i).norm() * dt_s < kFarTurn_rad) return;
  const Vec3 motion = dt_s * bodies.velocity(i),
             offset = bodies.has_offsets ? bodies.origin_offset[i] : Vec3(Vec3::Zero());
  const float reach = bodies.bounding_radius[i] + margin;
  const auto is_beyond = [&](const Contact& c) {
    return c.separation - c.normal.dot(c.anchor + offset) > reach + std::max(0.0F, -c.normal.dot(motion));
  };
  contacts.erase(std::remove_if(contacts.begin() + first, contacts.end(), is_beyond), contacts.end());
}

}  // namespace

void CollisionPipeline::collide_slab(const BodyStore& bodies, int slab, SlabResults& results) {
  const ContactList &pairs = results.pair_contacts, &statics = results.static_contacts;
  const auto contact_count = [&] { return pairs.contacts.size() + statics.contacts.size(); };
  const std::size_t pairs_before = pairs.manifolds.size(), statics_before = statics.manifolds.size(),
                    contacts_before = contact_count();
  results.end_of_pairs = pairs_before + max_pairs_;
  try {
    if (slab + 1 == partition_.slab_count())
      collide_large_bodies(bodies, results);
    else
      collide_bodies_in_cells(bodies, partition_.sorted_bodies_of(slab), results);
  } catch (const Overloaded&) {
    results.overloaded = true;
  }
  results.pair_count = pairs.manifolds.size() - pairs_before;
  results.static_count = statics.manifolds.size() - statics_before;
  results.contact_count = contact_count() - contacts_before;
}

void CollisionPipeline::collide_bodies_in_cells(const BodyStore& bodies, IndexRange sorted,
                                                SlabResults& results) const {
  for (int k = sorted.begin; k < sorted.end; ++k) {
    const Index i = grid_->body(k);
    collide_static(bodies, i, results);
    const IndexRange neighbours = large_neighbours_of_[i];
    for (int n = neighbours.begin; n < neighbours.end; ++n) {
      const Index large = large_neighbours_[n].large;
      if (!bodies.is_static(large)) collide_pair(bodies, i, large, results);
    }
    // The sleepers in the way of a fast body are among the neighbours above.
    if (!has_sleepers() || (!fast_bodies_.empty() && is_fast(i))) continue;
    const Vec3 half = Vec3::Constant(query_radius_[i]);
    const Vec3 low = bodies.position[i] - half, high = bodies.position[i] + half;
    if ((low.array() > sleepers_high_.array()).any() || (high.array() < sleepers_low_.array()).any())
      continue;
    sleeper_grid_.for_each_in_box(low, high, [&](std::int32_t j) {
      const float radius_sum = query_radius_[i] + query_radius_[j];
      if ((bodies.position[i] - bodies.position[j]).squaredNorm() < radius_sum * radius_sum)
        collide_pair(bodies, i, j, results);
    });
  }
  // The pairs of fast bodies are among the neighbours above.
  if (fast_bodies_.empty())
    grid_->for_each_pair(sorted.begin, sorted.end,
                         [&](std::int32_t i, std::int32_t j) { collide_pair(bodies, i, j, results); });
  else
    grid_->for_each_pair(sorted.begin, sorted.end, [&](std::int32_t i, std::int32_t j) {
      if (!is_fast(i) && !is_fast(j)) collide_pair(bodies, i, j, results);
    });
}

void CollisionPipeline::collide_large_bodies(const BodyStore& bodies, SlabResults& results) const {
  const auto large = grid_->large_bodies();
  for (std::size_t k = 0; k < large.size(); ++k) {
    const Index i = large[k];
    if (bodies.is_static(i)) continue;
    collide_static(bodies, i, results);
    for (std::size_t other = k + 1; other < large.size(); ++other) {
      const Index j = large[other];
      if (!bodies.is_static(j)) collide_pair(bodies, i, j, results);
    }
    if (!has_sleepers()) continue;
    const auto collide = [&](std::int32_t sleeper) { collide_pair(bodies, i, sleeper, results); };
    for_each_in_reach_of_large(bodies, sleeper_grid_, i, collide);
    std::ranges::for_each(sleeper_grid_.large_bodies(), collide);
  }
}

void CollisionPipeline::collide_static(const BodyStore& bodies, std::size_t i, SlabResults& results) const {
  ContactList& out = results.static_contacts;
  const auto first = static_cast<std::int32_t>(out.contacts.size());
  const Vec3 centre = bodies.origin(i);
  const float margin = std::max(kMinSpeculativeMargin, speculative_margin_[i] + field_.max_speed * dt_s_);
  const ContactList& previous_list = previous_contacts_.static_contacts();
  const int known = previous_contacts_.find_static(i, results.member);
  const auto previous =
      known < 0 ? std::span<const Contact>() : previous_list.contacts_of(previous_list.manifolds[known]);
  if (bodies.is_sphere[i])
    collider_.collide_sphere_with_columns(centre, bodies.bounding_radius[i], margin,
                                          {bodies.velocity(i), dt_s_}, out.contacts);
  else if (collider_.free_layout() || field_.has_contacts_per_cell() || bodies.rolls_unevenly[i])
    collider_.collide_columns(*bodies.shape[i], centre, bodies.axes[i], margin, out.contacts);
  else
    field_cache_.collide(bodies, i, margin, previous, results.cached_field, out.contacts);
  drop_out_of_reach(bodies, i, dt_s_, kMinSpeculativeMargin + field_.max_speed * dt_s_, first, out.contacts);
  const std::size_t field_contacts = out.contacts.size() - first;
  if (collider_.has_skin_or_tips())
    collider_.collide_skin_or_tips(*bodies.shape[i], centre, bodies.axes[i], margin, out.contacts);
  if (centre.z() - bodies.bounding_radius[i] - margin < ground_height_) {
    const std::size_t ground_contacts = out.contacts.size();
    collide_shape_with_ground(*bodies.shape[i], centre, bodies.axes[i], ground_height_, margin, out.contacts);
    drop_out_of_reach(bodies, i, dt_s_, kMinSpeculativeMargin, ground_contacts, out.contacts);
  }
  const bool in_cells = query_radius_[i] <= large_radius_;
  if (!in_cells || large_neighbours_of_[i].begin < large_neighbours_of_[i].end)
    collide_static_bodies(bodies, i, results);
  const auto count = static_cast<std::int32_t>(out.contacts.size()) - first;
  if (count == 0) return;
  out.manifolds.push_back({static_cast<std::int32_t>(i), Manifold::kStatic, first, count});
  const auto contacts = std::span(out.contacts).subspan(first);
  move_static_points(bodies, i, contacts);
  anchor_at_centre_of_mass(bodies, i, contacts);
  match_contacts(out, out.manifolds.back(), previous_list, known, 0.15F * bodies.bounding_radius[i]);
  if (field_contacts > 1 && !bodies.is_sphere[i]) find_support(bodies, i, margin, field_contacts, results);
}

// Moves the points of a body's contacts with what is static. On cells those of a sphere stay below its
// centre.
void CollisionPipeline::move_static_points(const BodyStore& bodies, std::size_t i,
                                           std::span<Contact> contacts) const {
  const bool rolls_on_cells = !bodies.is_sphere[i] && may_roll(bodies, i);
  for (Contact& c : contacts) {
    const auto other = static_cast<std::size_t>(c.partner);
    if (c.touches_body() && !bodies.is_sphere[i] && may_roll(bodies, other))
      move_rolling_points(bodies, i, other, mean_substep_start_s_, {&c, 1});
    else if (rolls_on_cells)
      move_rolling_points(bodies, i, std::nullopt, mean_substep_start_s_, {&c, 1});
  }
}

// Finds the support patch of the last manifold's body. The patch takes over the load and the friction of the
// manifold's first `field_contacts`, those with columns of the field.
void CollisionPipeline::find_support(const BodyStore& bodies, std::size_t i, float margin,
                                     std::size_t field_contacts, SlabResults& results) const {
  SupportPatches& supports = *results.supports;
  Manifold& manifold = results.static_contacts.manifolds.back();
  std::vector<Contact>& list = results.static_contacts.contacts;
  const auto contacts = std::span(list).subspan(manifold.first, field_contacts);
  const SupportReference from = previous_support_of_body_[i];
  const SupportPatches* const previous = from.slab < 0 ? nullptr : &previous_supports_[from.slab];
  const float max_stiffness =
      field_.has_elastic_tops ? greatest_elastic_stiffness(bodies, i, previous, from.patch, contacts) : 0.0F;
  if (!add_support_patch(field_, collider_.free_layout(), bodies, static_cast<std::int32_t>(i), margin,
                         max_stiffness, contacts, supports))
    return;
  SupportPatch& patch = supports.patches.back();
  if (patch.has_shares)
    remove_points_without_share(supports, [&](std::int32_t k) {
      list.erase(list.begin() + manifold.first + k);
      --manifold.count;
    });
  for (int k = patch.first_point; k < patch.first_point + patch.point_count; ++k) {
    const Index point = supports.points[k];
    contacts[point].partner = patch.is_elastic ? Partner::kElasticTop : Partner::kSupportedCell;
    if (patch.is_elastic) contacts[point].normal_impulse = 0.0F;
  }
  if (previous) match_support_patch(*previous, previous->patches[from.patch], supports, patch);
}

// A load that would swing on its springs by more than about two radians in a substep compresses them by less
// than a rigid contact lets it sink. It is as heavy as the body, or as what this bore in the last step.
float CollisionPipeline::greatest_elastic_stiffness(const BodyStore& bodies, std::size_t i,
                                                    const SupportPatches* previous, std::int32_t patch,
                                                    std::span<const Contact> contacts) const {
  constexpr float kRigidStiffness = 4.0F;  // × load / substep²
  // So that a load that trembles does not alternate between the two laws.
  constexpr float kHysteresis = 2.0F;
  float load = 0.0F;  // impulse over the step
  const SupportPatch* const last = previous ? &previous->patches[patch] : nullptr;
  const bool was_elastic = last != nullptr && last->is_elastic;
  if (was_elastic)
    for (Index k = last->first; k < last->first + last->count; ++k) load += previous->samples.load[k];
  else
    for (const Contact& c : contacts)
      load += std::max(0.0F, c.normal.z()) * c.normal_impulse * dt_s_ / substep_s_;
  float mass = bodies.mass[i];
  if (gravity_ > 0.0F) mass = std::max(mass, load / (gravity_ * dt_s_));
  return (was_elastic ? kHysteresis : 1.0F) * kRigidStiffness * mass / (substep_s_ * substep_s_);
}

// The static bodies near a body. What it meets in the course of the step is found where it meets the first of
// them; what would be hit later is left to later steps, because the first impact changes its path.
void CollisionPipeline::collide_static_bodies(const BodyStore& bodies, std::size_t i,
                                              SlabResults& results) const {
  thread_local std::vector<StaticNeighbour> near;
  near.clear();
  const auto add = [&](std::int32_t other) {
    if (bodies.is_static(other) && bodies.may_touch(i, other)) near.push_back({.body = other});
  };
  if (query_radius_[i] <= large_radius_)
    for (int n = large_neighbours_of_[i].begin; n < large_neighbours_of_[i].end; ++n)
      add(large_neighbours_[n].large);
  else
    std::ranges::for_each(grid_->large_bodies(), add);
  if (near.empty()) return;
  float first_impact_s = PairSweep::kNever;
  for (StaticNeighbour& n : near) {
    if (!may_any_pass_ || (!may_pass(i, n.body) && !is_fast(i))) continue;
    n.is_swept = true;
    results.swept_pairs.emplace_back(static_cast<std::int32_t>(i), n.body);
    n.impact_s = PairSweep(bodies, i, n.body, dt_s_).time_of_impact();
    first_impact_s = std::min(first_impact_s, n.impact_s);
  }
  std::vector<Contact>& contacts = results.static_contacts.contacts;
  const std::size_t first = contacts.size();
  for (StaticNeighbour& n : near) {
    if (n.is_swept && n.impact_s != PairSweep::kNever &&
        (n.impact_s - first_impact_s) * travel_[i] > kMinSpeculativeMargin * dt_s_)
      n.impact_s = PairSweep::kNever;
    if (n.impact_s == PairSweep::kNever) n.impact_s = 0.0F;
    collide_static_body(bodies, i, n, results);
  }
  if (contacts.size() == first) return;
  const auto touches = [](const StaticNeighbour& n) { return n.end > n.first; };
  if (std::ranges::count_if(near, touches) > 1) keep_friction_of_twist(std::span(contacts).subspan(first));
  correct_internal_edges(bodies, i, near, contacts);
  for (const StaticNeighbour& n : near)
    if (n.impact_s > 0.0F)
      PairSweep(bodies, i, n.body, dt_s_)
          .move_to_start(n.impact_s, std::span(contacts).subspan(n.first, n.end - n.first));
  erase_spare(contacts, first);
}

void CollisionPipeline::collide_static_body(const BodyStore& bodies, std::size_t i, StaticNeighbour& other,
                                            SlabResults& results) const {
  std::vector<Contact>& contacts = results.static_contacts.contacts;
  other.first = contacts.size();
  if (other.is_swept)
    PairSweep(bodies, i, other.body, dt_s_).collide_at(other.impact_s, kMinSpeculativeMargin, contacts);
  else
    collide_bodies(bodies, i, other.body, speculative_margin_[i], dt_s_,
                   previous_contacts_.find_static_normal(i, other.body, results.member), contacts);
  other.end = contacts.size();
  for (std::size_t k = other.first; k < other.end; ++k) contacts[k].partner = Partner{other.body};
}

void CollisionPipeline::correct_internal_edges(const BodyStore& bodies, std::size_t i,
                                               std::span<const StaticNeighbour> near,
                                               std::vector<Contact>& contacts) const {
  thread_local std::vector<Solid> solids;
  thread_local std::vector<SeamContact> seam;
  solids.clear(), seam.clear();
  for (const StaticNeighbour& n : near) {
    solids.push_back({*bodies.shape[n.body], bodies.origin(n.body), bodies.axes[n.body]});
    const Vec3 origin =
        n.impact_s > 0.0F ? PairSweep(bodies, i, n.body, dt_s_).origin_of_a(n.impact_s) : bodies.origin(i);
    for (std::size_t k = n.first; k < n.end; ++k) seam.push_back({&contacts[k], origin, origin});
  }
  if (may_have_internal_edges(solids))
    mark_internal_edges(solids, true, *bodies.shape[i], bodies.axes[i], seam);
}

void CollisionPipeline::collide_pair(const BodyStore& bodies, std::size_t i, std::size_t j,
                                     SlabResults& results) const {
  ++results.tested_pairs;
  if (!bodies.may_touch(i, j)) return;
  const std::size_t a = std::min(i, j), b = std::max(i, j);
  const bool has_sphere = bodies.is_sphere[a] || bodies.is_sphere[b];
  ContactList& pair_contacts = results.pair_contacts;
  if (pair_contacts.manifolds.size() >= results.end_of_pairs) throw Overloaded();
  const auto first = static_cast<std::int32_t>(pair_contacts.contacts.size());
  PairManifoldCache::Points points;
  const bool is_swept =
      may_any_pass_ && ((!fast_bodies_.empty() && (is_fast(a) || is_fast(b))) || may_pass(a, b));
  if (is_swept) {
    collide_swept_pair(bodies, a, b, results);
  } else if (has_sphere || bodies.rolls_unevenly[a] || bodies.rolls_unevenly[b]) {
    collide_bodies(bodies, a, b, kMinSpeculativeMargin, dt_s_, nullptr, pair_contacts.contacts);
  } else {
    const Vec3 gap =
        (bodies.position[a] - bodies.position[b]).cwiseAbs() - half_extents_[a] - half_extents_[b];
    const float separation = gap.maxCoeff();
    // Bodies close by less than they travel; the allowance is for rounding.
    constexpr float kRoundingFactor = 1.001F, kRounding = 1e-3F;
    const float greatest_margin =
        kMinSpeculativeMargin + kRoundingFactor * (travel_[a] + travel_[b]) + kRounding;
    if (separation > greatest_margin + PairManifoldCache::kHorizon) return;
    const float margin = kMinSpeculativeMargin + closing_distance(bodies, a, b, dt_s_);
    if (separation > margin + PairManifoldCache::kHorizon) return;
    points = pair_cache_.collide(bodies, a, b, margin, results.cached_pairs, pair_contacts.contacts);
  }
  // Kept manifolds are corrected when they are made.
  if (any_compound_ && !is_swept && (has_sphere || bodies.rolls_unevenly[a] || bodies.rolls_unevenly[b]))
    world::correct_internal_edges({*bodies.shape[a], bodies.origin(a), bodies.axes[a]},
                                  {*bodies.shape[b], bodies.origin(b), bodies.axes[b]},
                                  pair_contacts.contacts, first);
  const auto count = static_cast<std::int32_t>(pair_contacts.contacts.size()) - first;
  if (count == 0) return;
  pair_contacts.manifolds.push_back(
      {static_cast<std::int32_t>(a), static_cast<std::int32_t>(b), first, count});
  for (const std::size_t body : {a, b})
    if (bodies.asleep[body]) results.touched_sleepers.push_back(static_cast<std::int32_t>(body));
  const auto contacts = std::span(pair_contacts.contacts).subspan(first);
  const bool both_spheres = bodies.is_sphere[a] && bodies.is_sphere[b];
  results.has_flat_pair |= !both_spheres;
  if (!is_swept) predict_meetings(bodies, a, b, dt_s_, contacts);
  if (!is_swept && !both_spheres && (may_roll(bodies, a) || may_roll(bodies, b)))
    move_rolling_points(bodies, a, b, mean_substep_start_s_, contacts);
  anchor_at_centre_of_mass(bodies, a, contacts);
  // A sphere has a single contact per partner, whose anchor may move far in one step.
  const float tolerance = has_sphere ? bodies.bounding_radius[a] : 0.15F * bodies.bounding_radius[a];
  const ContactList& previous = previous_contacts_.pair_contacts();
  const int known = previous_contacts_.find_pair(a, b, results.member, results.expected_pair);
  const Manifold& manifold = pair_contacts.manifolds.back();
  if (known < 0 || !match_points(pair_contacts.contacts_of(manifold),
                                 previous.contacts_of(previous.manifolds[known]), points, tolerance))
    match_contacts(pair_contacts, manifold, previous, known, tolerance);
}

void CollisionPipeline::collide_swept_pair(const BodyStore& bodies, std::size_t a, std::size_t b,
                                           SlabResults& results) const {
  const PairSweep sweep(bodies, a, b, dt_s_);
  const float reach =
      bodies.bounding_radius[a] + bodies.bounding_radius[b] + sweep.travel() + kMinSpeculativeMargin;
  if ((bodies.position[a] - bodies.position[b]).squaredNorm() > reach * reach) return;
  results.swept_pairs.emplace_back(static_cast<std::int32_t>(a), static_cast<std::int32_t>(b));
  std::vector<Contact>& contacts = results.pair_contacts.contacts;
  const float impact_s = sweep.time_of_impact(), at_s = impact_s == PairSweep::kNever ? 0.0F : impact_s;
  const std::size_t first = contacts.size();
  sweep.collide_at(at_s, kMinSpeculativeMargin, contacts);
  sweep.correct_internal_edges(at_s, contacts, first);
  sweep.move_to_start(at_s, std::span(contacts).subspan(first));
}

}  // namespace smartsurf::world
