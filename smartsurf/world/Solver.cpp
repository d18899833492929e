#include "smartsurf/world/Solver.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>

namespace smartsurf::world {
namespace {

// How overlaps are pushed apart: as a damped spring of this frequency, at most a quarter of the substeps',
// and ratio.
constexpr float kPairHz = 60.0F, kWorldHz = 120.0F, kDampingRatio = 5.0F;
constexpr float kFastestPush = 4.0F;      // u/s
constexpr float kBounceThreshold = 0.2F;  // nothing rebounds from slower, u/s
constexpr float kWideGap = 1e6F;
constexpr float kTopSpeed = 1e7F;  // u/s or rad/s along each axis; scripts may ask for a tenth of it

Pass softness(float h_s, float hertz, int substeps) {
  const float omega = 2.0F * std::numbers::pi_v<float> * std::min(hertz, 0.25F / h_s);
  const float a = 2.0F * kDampingRatio + h_s * omega, b = h_s * omega * a, scale = 1.0F / (1.0F + b);
  return {h_s,   1.0F / h_s,   0.0F,             omega / a,                           b * scale,
          scale, kFastestPush, kBounceThreshold, 1.0F / static_cast<float>(substeps)};
}

Vec3 vec(const float (&v)[3]) { return Vec3(v); }
void put(float (&to)[3], const Vec3& from) {
  for (int i = 0; i < 3; ++i) to[i] = from[i];
}
void put(float (*to)[kLanes], int lane, const Vec3& from) {
  for (int i = 0; i < 3; ++i) to[i][lane] = from[i];
}
Vec3 take(const float (*from)[kLanes], int lane) { return {from[0][lane], from[1][lane], from[2][lane]}; }

// A body that a huge force flings away stays finite: it leaves the table and disturbs nobody else.
void limit(Vec3& velocity) { velocity = velocity.cwiseMax(-kTopSpeed).cwiseMin(kTopSpeed); }

}  // namespace

struct Solver::Job {
  BodyStore& bodies;
  const std::vector<std::int32_t>& moving;
  ContactList &pairs, &world;
  BodyRows rows;
  Pass pair_pass, world_pass;
  const KernelTable& kernels;
  bool bounces;
  bool limited;  // whether any cell is limited in force
};

void Solver::step(BodyStore& bodies, const std::vector<std::int32_t>& moving, ContactList& pairs,
                  ContactList& world, bool limited, Team& team) {
  const float h_s = settings_.dt_s / static_cast<float>(settings_.substeps);
  schedule_.build(bodies, pairs, world);
  point_.resize(static_cast<std::size_t>(schedule_.points()));
  detail_.resize(point_.size());
  const bool bounces =
      settings_.field_restitution > 0.0F ||
      std::any_of(bodies.restitution.begin(), bodies.restitution.end(), [](float e) { return e > 0; });
  Job job{bodies,
          moving,
          pairs,
          world,
          bodies.rows(),
          softness(h_s, kPairHz, settings_.substeps),
          softness(h_s, kWorldHz, settings_.substeps),
          contact_kernels(),
          bounces,
          limited};
  constexpr int kWorthSharing = 256;
  team.run(schedule_.octets() > kWorthSharing, [&](const Member& member) { work(job, member); });
}

void Solver::work(Job& job, const Member& member) {
  const Range octets = schedule_.share({0, schedule_.octets()}, member.index, member.members);
  for (int i = octets.begin; i < octets.end; ++i) fill(job, i);
  const Range bodies = member.share(static_cast<int>(job.moving.size()));
  member.wait();
  begin_substep(job, bodies, true);
  member.wait();
  const KernelTable& k = job.kernels;
  sweep(job, member, k.warm, 0.0F);
  const float h_s = job.pair_pass.h_s;
  for (int s = 0; s < settings_.substeps; ++s) {
    if (s > 0) {
      begin_substep(job, bodies, false);
      member.wait();
    }
    sweep(job, member, k.solve, static_cast<float>(s) * h_s);
    advance(job, bodies);
    member.wait();
    sweep(job, member, k.relax, 0.0F);
    end_substep(job, bodies);
  }
  if (job.bounces) {
    member.wait();
    sweep(job, member, k.rebound, 0.0F);
  }
  for (int i = octets.begin; i < octets.end; ++i) read_back(job, i);
}

// ---- contacts into lanes, and back

void Solver::fill(Job& job, int index) {
  Octet& o = schedule_.octet(index);
  clear_points(o);
  const bool pair = schedule_.pair(index);
  const ContactList& list = pair ? job.pairs : job.world;
  for (int lane = 0; lane < o.count; ++lane)
    fill_lane(job, o, lane, list.manifolds[static_cast<std::size_t>(schedule_.manifold(index, lane))],
              list.contacts);
  if (!pair && job.limited) fill_limits(o, index, list);
  for (int k = 0; k < o.points; ++k) {
    const PointDetail& d = detail_[static_cast<std::size_t>(o.first + k)];
    for (int lane = 0; lane < o.count; ++lane) o.rolls |= d.rolling[lane] > 0.0F;
  }
  bool round = true;
  for (int lane = 0; lane < o.count; ++lane) {
    round &= job.bodies.round[static_cast<std::size_t>(o.a[lane])] != 0;
    if (pair) round &= job.bodies.round[static_cast<std::size_t>(o.b[lane])] != 0;
  }
  const ContactKind kind = pair ? (round ? kRoundPair : kAnyPair) : (round ? kRoundWorld : kAnyWorld);
  job.kernels.prepare[kind](&o, 1, points(), job.rows, job.pair_pass);
}

void Solver::clear_points(const Octet& o) {
  const auto first = static_cast<std::size_t>(o.first), count = static_cast<std::size_t>(o.points);
  std::memset(static_cast<void*>(&point_[first]), 0, sizeof(Point) * count);
  std::memset(static_cast<void*>(&detail_[first]), 0, sizeof(PointDetail) * count);
  for (std::size_t k = first; k < first + count; ++k) std::fill_n(point_[k].gap, kLanes, kWideGap);
}

void Solver::fill_lane(Job& job, const Octet& o, int lane, const Manifold& m,
                       const std::vector<Contact>& contacts) {
  const BodyStore& bodies = job.bodies;
  const auto a = static_cast<std::size_t>(m.a), b = static_cast<std::size_t>(std::max(m.b, 0));
  const bool pair = m.b >= 0;
  const bool round = bodies.round[a] && (!pair || bodies.round[b]);
  for (int k = 0; k < m.count; ++k) {
    const Contact& c = contacts[static_cast<std::size_t>(m.first + k)];
    Point& p = point_[static_cast<std::size_t>(o.first + k)];
    PointDetail& d = detail_[static_cast<std::size_t>(o.first + k)];
    put(p.normal, lane, c.normal);
    if (round) {
      p.radius_a[lane] = bodies.reach[a];
      if (pair) p.radius_b[lane] = bodies.reach[b];
    } else {
      put(d.arm_a, lane, c.arm);
      if (pair) put(d.arm_b, lane, bodies.position[a] + c.arm - bodies.position[b]);
    }
    p.gap[lane] = c.gap;
    p.push[lane] = c.push;
    put(p.drag, lane, c.drag);
    put(d.roll, lane, c.roll);
    float friction = settings_.field_friction_root, rolling = settings_.field_rolling_root,
          restitution = settings_.field_restitution;
    if (pair || c.other >= 0) {
      const std::size_t other = pair ? b : static_cast<std::size_t>(c.other);
      friction = bodies.friction_root[other];
      rolling = bodies.rolling_root[other];
      restitution = bodies.restitution[other];
    }
    p.friction[lane] = bodies.friction_root[a] * friction;
    d.rolling[lane] = bodies.rolling_root[a] * rolling;
    d.restitution[lane] = std::max(bodies.restitution[a], restitution);
    if (pair) continue;
    put(d.surface, lane, c.surface);
    d.surface_spin[lane] = c.surface_spin;
  }
}

void Solver::fill_limits(Octet& o, int index, const ContactList& list) {
  constexpr float kAny = 1e30F;
  for (int k = o.first; k < o.first + o.points; ++k)
    std::fill_n(detail_[static_cast<std::size_t>(k)].limit, kLanes, kAny);
  for (int lane = 0; lane < o.count; ++lane) {
    const Manifold& m = list.manifolds[static_cast<std::size_t>(schedule_.manifold(index, lane))];
    for (int k = 0; k < m.count; ++k) {
      const float limit = list.contacts[static_cast<std::size_t>(m.first + k)].limit;
      if (std::isinf(limit)) continue;
      detail_[static_cast<std::size_t>(o.first + k)].limit[lane] = limit;
      o.limited = true;
    }
  }
}

void Solver::read_back(Job& job, int index) {
  const Octet& o = schedule_.octet(index);
  ContactList& list = schedule_.pair(index) ? job.pairs : job.world;
  for (int lane = 0; lane < o.count; ++lane) {
    const Manifold& m = list.manifolds[static_cast<std::size_t>(schedule_.manifold(index, lane))];
    for (int k = 0; k < m.count; ++k) {
      Contact& c = list.contacts[static_cast<std::size_t>(m.first + k)];
      const Point& p = point_[static_cast<std::size_t>(o.first + k)];
      c.push = p.push[lane];
      c.total = p.total[lane];
      c.drag = take(p.drag, lane);
      if (o.rolls) c.roll = take(detail_[static_cast<std::size_t>(o.first + k)].roll, lane);
    }
  }
}

// ---- bodies through a substep

// Contacts act alike from substep to substep, because their normals and arms stay: what they gave each body
// in the last one, they give it again to start with.
void Solver::begin_substep(Job& job, Range range, bool first) {
  BodyStore& b = job.bodies;
  const float h_s = job.pair_pass.h_s;
  for (int k = range.begin; k < range.end; ++k) {
    const auto i = static_cast<std::size_t>(job.moving[static_cast<std::size_t>(k)]);
    Motion& m = b.motion[i];
    const surface::Wrench& w = b.wrench[i];
    b.start_velocity[i] = vec(m.velocity) + h_s * (settings_.gravity + m.inverse_mass * w.force);
    b.start_spin[i] = vec(m.spin);
    if (!w.torque.isZero(0.0F)) {
      const Inertia& q = b.inertia[i];
      b.start_spin[i] +=
          h_s * Vec3(Vec3(q.xx, q.xy, q.xz).dot(w.torque), Vec3(q.xy, q.yy, q.yz).dot(w.torque),
                     Vec3(q.xz, q.yz, q.zz).dot(w.torque));
    }
    limit(b.start_velocity[i]);
    limit(b.start_spin[i]);
    if (first) {
      b.shift[i] = {};
      put(m.velocity, b.start_velocity[i]);
      put(m.spin, b.start_spin[i]);
    } else {
      put(m.velocity, b.start_velocity[i] + b.velocity_gain[i]);
      put(m.spin, b.start_spin[i] + b.spin_gain[i]);
    }
  }
}

void Solver::advance(Job& job, Range range) {
  const float h_s = job.pair_pass.h_s;
  for (int k = range.begin; k < range.end; ++k) {
    const auto i = static_cast<std::size_t>(job.moving[static_cast<std::size_t>(k)]);
    const Motion& m = job.bodies.motion[i];
    Shift& s = job.bodies.shift[i];
    for (int axis = 0; axis < 3; ++axis) {
      s.by[axis] += h_s * m.velocity[axis];
      s.turn[axis] += h_s * m.spin[axis];
    }
  }
}

void Solver::end_substep(Job& job, Range range) {
  BodyStore& b = job.bodies;
  for (int k = range.begin; k < range.end; ++k) {
    const auto i = static_cast<std::size_t>(job.moving[static_cast<std::size_t>(k)]);
    b.velocity_gain[i] = vec(b.motion[i].velocity) - b.start_velocity[i];
    b.spin_gain[i] = vec(b.motion[i].spin) - b.start_spin[i];
  }
}

// ---- one pass over all contacts: pairs colour by colour, the world last, because nothing yields there

void Solver::sweep(Job& job, const Member& member, const Kernel (&kernel)[kContactKinds], float elapsed_s) {
  Pass pair = job.pair_pass, world = job.world_pass;
  pair.elapsed_s = world.elapsed_s = elapsed_s;
  auto run = [&](ContactKind kind, Range octets, const Pass& pass) {
    if (octets.begin < octets.end)
      kernel[kind](schedule_.octets_from(octets.begin), octets.end - octets.begin, points(), job.rows, pass);
  };
  auto run_share = [&](ContactKind kind, const OctetRun& octets, const Pass& pass) {
    run(kind, schedule_.share(octets, member.index, member.members), pass);
  };
  bool alone = false;
  for (const Schedule::Colour& c : schedule_.colours()) {
    // Colours too small to share follow each other on one member, without waiting.
    constexpr int kWorthSharing = 8;
    const bool share = !c.in_order && c.round.count + c.any.count >= kWorthSharing;
    if (share && alone) member.wait();
    alone = !share;
    if (share) {
      run_share(kRoundPair, c.round, pair);
      run_share(kAnyPair, c.any, pair);
      member.wait();
    } else if (member.first()) {
      run(kRoundPair, {c.round.first, c.round.first + c.round.count}, pair);
      run(kAnyPair, {c.any.first, c.any.first + c.any.count}, pair);
    }
  }
  if (alone) member.wait();
  run_share(kRoundWorld, schedule_.round_world(), world);
  run_share(kAnyWorld, schedule_.any_world(), world);
  member.wait();
}

}  // namespace smartsurf::world
