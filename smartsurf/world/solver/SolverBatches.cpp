// Copies contacts to the SIMD batches of the kernels, and their impulses back.
#include <algorithm>
#include <cstddef>
#include <cstring>

#include "common/memory/Prefetch.h"
#include "smartsurf/world/contact/ContactMaterial.h"
#include "smartsurf/world/narrowphase/PairContacts.h"
#include "smartsurf/world/simd/Simd4.h"
#include "smartsurf/world/solver/Solver.h"
#include "smartsurf/world/solver/SpeedLimits.h"

namespace smartsurf::world {
namespace {

constexpr float kPressingNormalZ = 0.5F;  // of contacts that press a body down
// How far a body that gives way to one below it rises in a step, relative to that one.
constexpr float kMinEscape = 0.5F;
constexpr float kUnusedSeparation = 1e6F;  // of unused lanes: never in contact

// The floats of Contact, and the rows of four that batches copy: normal and anchor x; anchor y, z, separation
// and partner; normal and friction impulse; surface velocity and spin; rolling and total normal impulse.
constexpr std::size_t kNormalRow = 0, kAnchorRow = 16, kSurfaceRow = 36, kImpulseRow = 56, kRollingRow = 72;
static_assert(offsetof(Contact, normal) == kNormalRow && offsetof(Contact, anchor) == kAnchorRow - 4 &&
              offsetof(Contact, separation) == kAnchorRow + 8 &&
              offsetof(Contact, surface_velocity) == kSurfaceRow &&
              offsetof(Contact, surface_spin) == kSurfaceRow + 12 &&
              offsetof(Contact, normal_impulse) == kImpulseRow &&
              offsetof(Contact, friction_impulse) == kImpulseRow + 4 &&
              offsetof(Contact, rolling_impulse) == kRollingRow);
// A row of four contacts as one vector per float.
struct FourRows {
  Float4 x, y, z, w;
};
[[gnu::always_inline]] inline FourRows load_rows(const Contact* const* contacts, std::size_t row) {
  Float4 v[4];
  for (int i = 0; i < 4; ++i)
    std::memcpy(&v[i], reinterpret_cast<const char*>(contacts[i]) + row, sizeof(Float4));
  transpose4(v[0], v[1], v[2], v[3]);
  return {v[0], v[1], v[2], v[3]};
}
// The rows of four unused lanes.
FourRows rows_of_unused_lanes(std::size_t row) {
  FourRows rows{};
  if (row == kAnchorRow) rows.z += kUnusedSeparation;
  return rows;
}
void store_row(const Float4& v, Contact& to, std::size_t row) {
  std::memcpy(reinterpret_cast<char*>(&to) + row, &v, sizeof(v));
}
// The contact of an unused lane.
const Contact kNoContact = [] {
  Contact c;
  c.normal = c.anchor = Vec3::Zero();
  c.separation = kUnusedSeparation;
  return c;
}();

}  // namespace

// Batches are in the order of colours, so their contacts lie anywhere in the list.
void Solver::prefetch_contacts(StepContext& context, ContactKind kind, int index) const {
  constexpr std::size_t kLine = 64;
  if (index >= graph_.batch_count()) return;
  const ContactList& list = context.contact_list(kind);
  for (int lane = 0; lane < graph_.lane_count(index); ++lane) {
    const int manifold = graph_.manifold(index, lane);
    if (manifold >= std::ssize(list.manifolds)) return;  // a batch of another kind
    const Manifold& m = list.manifolds[manifold];
    const auto* const begin = reinterpret_cast<const char*>(list.contacts.data() + m.first);
    for (std::size_t at = 0; at < m.count * sizeof(Contact); at += kLine) common::prefetch(begin + at);
  }
}

void Solver::prepare_batch(StepContext& context, ContactKind kind, int index) {
  ContactBatch& o = graph_.reset_batch(index);
  set_batch_bodies(context, o, index, kind);
  shared_batches_.mark_foreign_rows(o, context.own_rows);
  const bool is_static = !is_pair(kind);
  if (!is_static && !is_sphere_kind(kind)) {  // seams have been corrected
    ContactList& pairs = context.input.pair_contacts;
    for (int lane = 0; lane < o.lane_count; ++lane) {
      const Manifold& m = pairs.manifolds[graph_.manifold(index, lane)];
      for (Contact& c : pairs.contacts_of(m)) move_to_meeting(context.bodies, m.a, m.b, c);
    }
  }
  const BatchContacts contacts = contacts_of_batch(context, kind, index);
  fill_points(context, kind, o, contacts);
  if (is_static && !context.input.cell_limits.empty())
    fill_impulse_limits(context, o, index, context.contact_list(kind));
  context.kernels.prepare[kind](&o, 1, batch_points(), context.solver_bodies, context.static_params);
  // How many points of a lane are unused depends on the other lanes, and these on the number of threads:
  // nobody may count them.
  for (int lane = 0; lane < o.lane_count; ++lane)
    for (int k = contacts.count[lane]; k < o.point_count; ++k) {
      BatchPoint& p = point_[o.first_point + k];
      p.normal_mass[lane] = p.tangent_mass[lane] = 0.0F;
    }
}

// Contacts that are about to be hit become candidates of the impact solver. They exert no impulse in the
// substeps, unless they bear a load already or the impact may exceed their force limit. Contacts without
// restitution do so only if the body lands flat, fast enough to be turned by the order in which the substeps
// solve the points.
void Solver::find_impact_candidates(StepContext& context, ContactKind kind, int index, const Member& member) {
  const ContactBatch& o = graph_.batch(index);
  float least_speed[kLanes] = {};
  for (int k = o.first_point; k < o.first_point + o.point_count; ++k)
    for (int lane = 0; lane < kLanes; ++lane)
      least_speed[lane] = std::min(least_speed[lane], point_[k].approach_speed[lane]);
  const ContactList& list = context.contact_list(kind);
  // The speed gained by gravity within a step is not an impact.
  const float plastic_threshold =
      std::max(kRestitutionThreshold, 2.0F * settings_.gravity.norm() * settings_.dt_s);
  const float threshold = context.any_restitution ? kRestitutionThreshold : plastic_threshold;
  for (int lane = 0; lane < o.lane_count; ++lane) {
    if (least_speed[lane] >= -threshold) continue;
    const int manifold = graph_.manifold(index, lane);
    const Manifold& m = list.manifolds[manifold];
    constexpr float kFlatness = 0.9F;
    const bool is_jointed = context.bodies.is_jointed[m.a] || (m.b >= 0 && context.bodies.is_jointed[m.b]);
    // Heavy islands solve the blow of a heavy body to a light one below it, which sweeps hardly do.
    const bool is_pressed =
        !is_jointed && is_pair(kind) &&
        HeavyIslandSolver::is_pressed(velocity_[o.a[lane]].inverse_mass, velocity_[o.b[lane]].inverse_mass,
                                      load_lane(point_[o.first_point].normal, lane), settings_.gravity);
    bool lands_flat = !is_jointed && !is_pressed && !is_sphere_kind(kind) && m.count > 1 &&
                      least_speed[lane] < -plastic_threshold;
    for (int k = 0; lands_flat && k < m.count; ++k)
      lands_flat = point_[o.first_point + k].approach_speed[lane] < kFlatness * least_speed[lane];
    for (int k = 0; k < m.count; ++k) {
      BatchPoint& p = point_[o.first_point + k];
      const float speed = p.approach_speed[lane];
      const Contact& c = list.contacts[m.first + k];
      constexpr float kLimitMargin = 4.0F;
      const bool is_limited = !is_pair(kind) && !context.input.cell_limits.empty() &&
                              context.input.cell_limits[m.first + k].is_limited();
      const bool in_substeps =
          c.normal_impulse > 0.0F || is_pressed ||
          (is_limited && c.max_cell_impulse < -kLimitMargin * p.normal_mass[lane] * speed);
      if (speed >= (in_substeps ? -kRestitutionThreshold : 0.0F)) continue;
      const float restitution =
          restitution_of(material_[o.a[lane]], material_of_b(context.bodies, settings_.field_material, m, c));
      if (restitution == 0.0F && (in_substeps || !lands_flat)) continue;
      impacts_.add(member.index, {is_pair(kind), in_substeps, manifold, m.first + k, speed});
      if (!in_substeps) p.normal_mass[lane] = p.tangent_mass[lane] = 0.0F;
    }
  }
}

void Solver::solve_impacts(StepContext& context, const Member& member) {
  impacts_.solve({.bodies = context.bodies,
                  .partition = context.partition,
                  .pair_contacts = context.input.pair_contacts,
                  .static_contacts = context.input.static_contacts,
                  .cell_limits = context.input.cell_limits,
                  .field_material = settings_.field_material,
                  .dt_s = settings_.dt_s,
                  .substeps = settings_.substeps,
                  .has_room = context.input.has_room,
                  .joints = context.input.joints,
                  .velocity = velocity_.data(),
                  .delta_pose = delta_pose_.data()},
                 member);
}

// Unused lanes refer to the bodies of the first lane, so that loads stay valid; they are never stored.
void Solver::set_batch_bodies(StepContext& context, ContactBatch& o, int index, ContactKind kind) {
  const ContactList& list = context.contact_list(kind);
  for (int lane = 0; lane < o.lane_count; ++lane) {
    const Manifold& m = list.manifolds[graph_.manifold(index, lane)];
    o.a[lane] = context.partition.row(m.a);
    o.b[lane] = m.b >= 0 ? context.partition.row(m.b) : o.a[lane];
  }
  std::fill(o.a + o.lane_count, o.a + kLanes, o.a[0]);
  std::fill(o.b + o.lane_count, o.b + kLanes, o.b[0]);
}

Solver::BatchContacts Solver::contacts_of_batch(const StepContext& context, ContactKind kind,
                                                int index) const {
  ContactList& list = context.contact_list(kind);
  BatchContacts of;
  for (int lane = 0; lane < graph_.lane_count(index); ++lane) {
    const Manifold& m = list.manifolds[graph_.manifold(index, lane)];
    of.manifold[lane] = &m;
    of.first[lane] = list.contacts.data() + m.first;
    of.count[lane] = m.count;
  }
  return of;
}

void Solver::set_friction(ContactBatch& o, LaneProperties& lanes, int lane, const SurfaceMaterial& b) const {
  const SurfaceMaterial& a = material_[o.a[lane]];
  lanes.friction[lane] = friction_of(a, b);
  lanes.rolling_friction[lane] = rolling_friction_of(a, b);
  o.has_rolling_friction |= lanes.rolling_friction[lane] > 0.0F;
}

Solver::LaneProperties Solver::properties_of_lanes(const StepContext& context, ContactKind kind,
                                                   ContactBatch& o, const BatchContacts& of) const {
  LaneProperties lanes;
  const std::vector<Vec3>& position = context.bodies.position;
  for (int lane = 0; lane < o.lane_count; ++lane) {
    const Manifold& m = *of.manifold[lane];
    lanes.radius_a[lane] = material_[o.a[lane]].radius;
    const auto set_face_patch = [&](int points) {
      if (points < 2) return;
      lanes.is_face_patch[lane] = 1.0F;
      o.has_face_patch = true;
    };
    if (!is_pair(kind)) {
      int patch_points = 0;
      for (int k = 0; k < m.count; ++k) {
        const Contact& c = of.first[lane][k];
        if (!of.has(lane, k)) continue;
        set_friction(o, lanes, lane, material_of_b(context.bodies, settings_.field_material, m, c));
        patch_points += c.touches_body() && c.twist_friction_loss > 0.0F ? 1 : 0;
      }
      set_face_patch(patch_points);
      continue;
    }
    const SurfaceMaterial& b = material_[o.b[lane]];
    lanes.radius_b[lane] = b.radius;
    set_friction(o, lanes, lane, b);
    if (is_sphere_kind(kind)) continue;
    if (of.first[lane]->twist_friction_loss > 0.0F) set_face_patch(m.count);
    store_lane(position[m.a], lanes.position_a, lane);
    store_lane(position[m.b], lanes.position_b, lane);
    store_lane(context.bodies.velocity(m.a) - context.bodies.velocity(m.b), lanes.relative_velocity, lane);
  }
  return lanes;
}

// Four lanes of a point, from `lane` on; leaves out what no kernel of the kind reads.
void Solver::fill_lanes(ContactKind kind, ContactBatch& o, const LaneProperties& lanes, int lane,
                        const Contact* const* four, BatchPoint& p, BatchPointDetail& d) {
  const bool of_pairs = is_pair(kind), of_spheres = is_sphere_kind(kind);
  const auto put = [lane](const Float4& values, float* to) { store4(values, to + lane); };
  const auto rows = [&](std::size_t row) {
    return lane < o.lane_count ? load_rows(four, row) : rows_of_unused_lanes(row);
  };
  const FourRows first = rows(kNormalRow), impulses = rows(kImpulseRow);
  put(first.x, p.normal[0]), put(first.y, p.normal[1]), put(first.z, p.normal[2]);
  put(impulses.x, p.normal_impulse);
  put(impulses.y, p.friction_impulse[0]), put(impulses.z, p.friction_impulse[1]);
  put(impulses.w, p.friction_impulse[2]);
  put(load4(lanes.friction + lane), p.friction);
  o.has_friction |= any_of(load4(lanes.friction + lane) != 0.0F);
  put(Float4{}, p.total_normal_impulse), put(Float4{}, p.relax_target_speed);
  if (of_spheres || of_pairs)
    put(load4(lanes.radius_a + lane), p.radius_a), put(load4(lanes.radius_b + lane), p.radius_b);
  if (of_spheres) {
    put(Float4{four[0]->separation, four[1]->separation, four[2]->separation, four[3]->separation},
        p.separation);
  } else {
    const FourRows second = rows(kAnchorRow);
    put(second.z, p.separation);
    put(impulses.x, d.steady_impulse);
    if (o.has_face_patch)
      put(Float4{four[0]->twist_friction_loss, four[1]->twist_friction_loss, four[2]->twist_friction_loss,
                 four[3]->twist_friction_loss} *
              load4(lanes.is_face_patch + lane),
          d.twist_friction_loss);
    const Float4 anchor[3] = {first.w, second.x, second.y};
    const Float4 time{four[0]->anchor_time_s, four[1]->anchor_time_s, four[2]->anchor_time_s,
                      four[3]->anchor_time_s};
    if (of_pairs) put(time, d.anchor_time);
    for (int i = 0; i < 3; ++i) {
      put(anchor[i], d.anchor_a[i]);
      if (of_pairs)
        put((load4(lanes.position_a[i] + lane) + anchor[i]) - load4(lanes.position_b[i] + lane) +
                time * load4(lanes.relative_velocity[i] + lane),
            d.anchor_b[i]);
    }
  }
  const FourRows surface = rows(kSurfaceRow);
  put(surface.x, d.surface_velocity[0]), put(surface.y, d.surface_velocity[1]);
  put(surface.z, d.surface_velocity[2]);
  if (!of_pairs) {
    put(surface.w, d.surface_spin);
    o.has_surface_spin |= any_of(surface.w != 0.0F);
  }
  for (int i = 0; i < 3 && !of_spheres; ++i) {
    const Float4 acceleration{four[0]->surface_acceleration[i], four[1]->surface_acceleration[i],
                              four[2]->surface_acceleration[i], four[3]->surface_acceleration[i]};
    put(acceleration, d.surface_acceleration[i]);
    o.has_moving_points |= any_of(acceleration != 0.0F);
  }
  if (o.has_rolling_friction) {
    const FourRows rolling = rows(kRollingRow);
    put(rolling.x, d.rolling_impulse[0]), put(rolling.y, d.rolling_impulse[1]);
    put(rolling.z, d.rolling_impulse[2]);
    put(load4(lanes.rolling_friction + lane), d.rolling_friction);
  }
}

// Copies contacts to the points of a batch.
void Solver::fill_points(const StepContext& context, ContactKind kind, ContactBatch& o,
                         const BatchContacts& of) {
  const bool of_pairs = is_pair(kind);
  LaneProperties lanes = properties_of_lanes(context, kind, o, of);
  for (int k = 0; k < o.point_count; ++k) {
    BatchPoint& p = point_[o.first_point + k];
    BatchPointDetail& d = detail_[o.first_point + k];
    const Contact* c[kLanes];
    std::fill_n(c, kLanes, &kNoContact);
    for (int lane = 0; lane < o.lane_count; ++lane) {
      if (!of.has(lane, k)) continue;
      c[lane] = of.first[lane] + k;
      if (of_pairs) continue;
      set_friction(o, lanes, lane,
                   material_of_b(context.bodies, settings_.field_material, *of.manifold[lane], *c[lane]));
      if (c[lane]->is_in_patch()) lanes.friction[lane] = 0.0F;
    }
    for (int lane = 0; lane < kLanes; lane += kSimd4Width) fill_lanes(kind, o, lanes, lane, c + lane, p, d);
    // Joints and contacts are solved apart and settle only with the softness.
    for (int lane = 0; !is_sphere_kind(kind) && lane < o.lane_count; ++lane) {
      const Manifold& m = *of.manifold[lane];
      if (context.bodies.is_jointed[m.a] || (m.b >= 0 && context.bodies.is_jointed[m.b]))
        d.steady_impulse[lane] = 0.0F;
    }
    for (int lane = 0; !of_pairs && lane < o.lane_count; ++lane)
      if (c[lane]->is_in_patch()) store_lane(Vec3::Zero(), p.friction_impulse, lane);
  }
}

void Solver::fill_impulse_limits(const StepContext& context, ContactBatch& o, int index,
                                 const ContactList& list) {
  auto limit_of = [&](const Manifold& m, int k) -> const CellImpulseLimit& {
    return context.input.cell_limits[m.first + k];
  };
  for (int lane = 0; lane < o.lane_count && !o.has_impulse_limit; ++lane) {
    const Manifold& m = list.manifolds[graph_.manifold(index, lane)];
    for (int k = 0; k < m.count; ++k) o.has_impulse_limit |= limit_of(m, k).is_limited();
  }
  if (!o.has_impulse_limit) return;
  const std::int32_t first = o.first_point;
  std::fill_n(&limit_[first], o.point_count, BatchPointLimit());
  for (int lane = 0; lane < o.lane_count; ++lane) {
    const Manifold& m = list.manifolds[graph_.manifold(index, lane)];
    for (int k = 0; k < m.count; ++k) {
      const CellImpulseLimit& limit = limit_of(m, k);
      if (!limit.is_limited()) continue;
      const Contact& c = list.contacts[m.first + k];
      BatchPointLimit& p = limit_[first + k];
      p.stall_impulse[lane] = c.max_cell_impulse * context.static_params.substep_fraction;
      p.no_load_speed[lane] = limit.no_load_speed;
      p.planned_speed[lane] = limit.planned_speed;
      p.to_first[lane] = limit.to_first;
      BatchPointLimit& cell = limit_[first + (k + limit.to_first)];
      cell.load[lane] += c.normal_impulse * c.normal.z();
      for (int axis = 0; axis < 3; ++axis)
        cell.anchor[axis][lane] += c.anchor[axis] / static_cast<float>(limit.point_count);
    }
  }
}

void Solver::store_impulses(StepContext& context, ContactKind kind, int index) {
  const ContactBatch& o = graph_.batch(index);
  const BatchContacts of = contacts_of_batch(context, kind, index);
  float depth[kLanes];
  std::fill_n(depth, kLanes, context.input.min_jam_depth);
  for (int k = 0; k < o.point_count; ++k) {
    const BatchPoint& p = point_[o.first_point + k];
    const BatchPointDetail& d = detail_[o.first_point + k];
    for (int lane = 0; lane < kLanes; lane += kSimd4Width) {
      store4(max(load4(depth + lane), -load4(p.separation + lane)), depth + lane);
      Float4 row[kSimd4Width] = {load4(p.normal_impulse + lane), load4(p.friction_impulse[0] + lane),
                                 load4(p.friction_impulse[1] + lane), load4(p.friction_impulse[2] + lane)};
      transpose4(row[0], row[1], row[2], row[3]);
      for (int i = 0; i < kSimd4Width; ++i)
        if (of.has(lane + i, k)) store_row(row[i], of.first[lane + i][k], kImpulseRow);
    }
    for (int lane = 0; lane < o.lane_count; ++lane) {
      if (!of.has(lane, k)) continue;
      Contact& c = of.first[lane][k];
      c.total_normal_impulse = p.total_normal_impulse[lane];
      if (o.has_rolling_friction) c.rolling_impulse = load_lane(d.rolling_impulse, lane);
    }
  }
  for (int lane = 0; lane < o.lane_count; ++lane) {
    const Manifold& m = *of.manifold[lane];
    if (depth[lane] > context.input.min_jam_depth) {
      const Contact& deepest = *std::min_element(
          of.first[lane], of.first[lane] + m.count,
          [](const Contact& one, const Contact& other) { return one.separation < other.separation; });
      // Spheres roll off each other.
      const float upward = kind == kSpherePair ? 0.0F : deepest.normal.z();
      if (m.b >= 0 && std::abs(upward) > kPressingNormalZ) {
        // A load that is thrown presses its parts into each other, but has a way out.
        const auto rise = [&](std::int32_t row) { return delta_pose_[row].translation[2]; };
        const float of_a = rise(o.a[lane]), of_b = rise(o.b[lane]);
        const float lower = upward > 0.0F ? of_b : of_a, upper = upward > 0.0F ? of_a : of_b;
        if (lower > 0.0F && upper >= kMinEscape * lower) continue;
      }
      context.jammed_bodies.push_back({m.a, depth[lane], upward < -kPressingNormalZ});
      if (m.b >= 0) context.jammed_bodies.push_back({m.b, depth[lane], upward > kPressingNormalZ});
    }
    if (!o.has_impulse_limit || is_pair(kind)) continue;
    for (int k = 0; k < m.count; ++k) {
      CellImpulseLimit& limit = context.input.cell_limits[m.first + k];
      if (limit.to_first == 0) limit.capacity = limit_[o.first_point + k].step_capacity[lane];
    }
  }
}

}  // namespace smartsurf::world
