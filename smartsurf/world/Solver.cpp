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
  return {h_s,          1.0F / h_s,       0.0F,
          omega / a,    b * scale,        scale,
          kFastestPush, kBounceThreshold, 1.0F / static_cast<float>(substeps)};
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
  const Input& input;
  const Slabs& slabs;
  Range mine;  // the member's slabs
  BodyRows rows;
  Pass pair_pass, world_pass;
  const KernelTable& kernels;
  bool bounces;

  ContactList& list(ContactKind kind) const { return is_pair(kind) ? input.pairs : input.world; }
  static bool is_pair(ContactKind kind) { return kind == kRoundPair || kind == kAnyPair; }
};

void Solver::step(BodyStore& bodies, const Input& input, const Member& member) {
  const Range mine = input.slabs.share(member);
  schedule_.build(bodies, input.pairs, input.pair_runs, input.world, input.world_runs, mine, member);
  member.alone([&] { make_room(input.slabs); });
  const float h_s = settings_.dt_s / static_cast<float>(settings_.substeps);
  const bool bounces =
      settings_.field_restitution > 0.0F ||
      std::any_of(bodies.restitution.begin(), bodies.restitution.end(), [](float e) { return e > 0; });
  Job job{bodies,
          input,
          input.slabs,
          mine,
          rows(),
          softness(h_s, kPairHz, settings_.substeps),
          softness(h_s, kWorldHz, settings_.substeps),
          contact_kernels(),
          bounces};
  work(job, member);
}

void Solver::make_room(const Slabs& slabs) {
  const auto rows = static_cast<std::size_t>(slabs.rows());
  motion_.resize(rows);
  shift_.resize(rows);
  inertia_.resize(rows);
  start_.resize(rows);
  point_.resize(static_cast<std::size_t>(schedule_.points()));
  detail_.resize(point_.size());
}

void Solver::work(Job& job, const Member& member) {
  load_rows(job);
  member.wait();
  for (const OctetRun& run : schedule_.share(member))
    for (int i = run.first; i < run.first + run.count; ++i) fill(job, run.kind, i);
  member.wait();
  for_moving(job, [&](int row) { start_row(job, row); });
  member.wait();
  const KernelTable& k = job.kernels;
  sweep(job, member, k.warm, 0.0F);
  const float h_s = job.pair_pass.h_s;
  for (int s = 0; s < settings_.substeps; ++s) {
    if (s > 0) {
      for_moving(job, [&](int row) { next_substep(job, row); });
      member.wait();
    }
    sweep(job, member, k.solve, static_cast<float>(s) * h_s);
    advance(job);
    member.wait();
    sweep(job, member, k.relax, 0.0F);
  }
  if (job.bounces) sweep(job, member, k.rebound, 0.0F);
  store_rows(job);
  for (const OctetRun& run : schedule_.share(member))
    for (int i = run.first; i < run.first + run.count; ++i) read_back(job, run.kind, i);
}

// ---- contacts into lanes, and back

void Solver::fill(Job& job, ContactKind kind, int index) {
  Octet& o = schedule_.clear_octet(index);
  set_bodies(job, o, index, kind);
  clear_points(o);
  const ContactList& list = job.list(kind);
  for (int lane = 0; lane < o.count; ++lane)
    fill_lane(job, o, lane, list.manifolds[static_cast<std::size_t>(schedule_.manifold(index, lane))],
              list.contacts);
  if (!Job::is_pair(kind) && job.input.limited) fill_limits(o, index, list);
  for (int k = 0; k < o.points; ++k) {
    const PointDetail& d = detail_[static_cast<std::size_t>(o.first + k)];
    for (int lane = 0; lane < o.count; ++lane) o.rolls |= d.rolling[lane] > 0.0F;
  }
  job.kernels.prepare[kind](&o, 1, points(), job.rows, job.pair_pass);
}

// Lanes not in use look at the first one's bodies.
void Solver::set_bodies(Job& job, Octet& o, int index, ContactKind kind) {
  const ContactList& list = job.list(kind);
  for (int lane = 0; lane < kLanes; ++lane) {
    const int i = schedule_.manifold(index, lane < o.count ? lane : 0);
    const Manifold& m = list.manifolds[static_cast<std::size_t>(i)];
    o.a[lane] = job.slabs.row(m.a);
    o.b[lane] = m.b >= 0 ? job.slabs.row(m.b) : o.a[lane];
  }
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

void Solver::read_back(Job& job, ContactKind kind, int index) {
  const Octet& o = schedule_.octet(index);
  ContactList& list = job.list(kind);
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

// ---- bodies through a substep, each member those of its slabs

template <class Each>
void Solver::for_moving(const Job& job, Each each) const {
  for (int s = job.mine.begin; s < job.mine.end; ++s) {
    const Range rows = job.slabs.moving_rows_of(s);
    for (int row = rows.begin; row < rows.end; ++row) each(row);
  }
}

void Solver::load_rows(Job& job) {
  const BodyStore& b = job.bodies;
  for (int s = job.mine.begin; s < job.mine.end; ++s) {
    const Range rows = job.slabs.rows_of(s);
    for (int row = rows.begin; row < rows.end; ++row) {
      const auto to = static_cast<std::size_t>(row);
      const std::size_t from = job.slabs.body(row);
      motion_[to] = b.motion[from];
      inertia_[to] = b.inertia[from];
      shift_[to] = {};
    }
  }
}

// What the forces do to the body in a substep.
void Solver::start_row(Job& job, int row) {
  const auto r = static_cast<std::size_t>(row);
  const float h_s = job.pair_pass.h_s;
  Motion& m = motion_[r];
  static const surface::Wrench kNone{};
  const surface::Wrench& w = job.input.pushed ? job.bodies.wrench[job.slabs.body(row)] : kNone;
  Vec3 velocity = vec(m.velocity) + h_s * (settings_.gravity + m.inverse_mass * w.force);
  Vec3 spin = vec(m.spin);
  if (!w.torque.isZero(0.0F)) {
    const Inertia& q = inertia_[r];
    spin += h_s * Vec3(Vec3(q.xx, q.xy, q.xz).dot(w.torque), Vec3(q.xy, q.yy, q.yz).dot(w.torque),
                       Vec3(q.xz, q.yz, q.zz).dot(w.torque));
  }
  limit(velocity);
  limit(spin);
  put(start_[r].velocity, velocity), put(start_[r].spin, spin);
  put(m.velocity, velocity), put(m.spin, spin);
}

// Contacts act alike from substep to substep, because their normals and arms stay: what they gave the body in
// the last one, they give it again to start with.
void Solver::next_substep(Job& job, int row) {
  const auto r = static_cast<std::size_t>(row);
  Motion& m = motion_[r];
  const Vec3 gain = vec(m.velocity) - vec(start_[r].velocity), turn = vec(m.spin) - vec(start_[r].spin);
  start_row(job, row);
  put(m.velocity, vec(m.velocity) + gain);
  put(m.spin, vec(m.spin) + turn);
}

void Solver::advance(Job& job) {
  const float h_s = job.pair_pass.h_s;
  for_moving(job, [&](int row) {
    const Motion& m = motion_[static_cast<std::size_t>(row)];
    Shift& s = shift_[static_cast<std::size_t>(row)];
    for (int axis = 0; axis < 3; ++axis) {
      s.by[axis] += h_s * m.velocity[axis];
      s.turn[axis] += h_s * m.spin[axis];
    }
  });
}

void Solver::store_rows(Job& job) {
  for_moving(job, [&](int row) {
    const std::size_t to = job.slabs.body(row);
    job.bodies.motion[to] = motion_[static_cast<std::size_t>(row)];
    job.bodies.shift[to] = shift_[static_cast<std::size_t>(row)];
  });
}

// ---- one pass over all contacts: pairs colour by colour, the world last, because nothing yields there

void Solver::sweep(Job& job, const Member& member, const Kernel (&kernel)[kContactKinds], float elapsed_s) {
  Pass pair = job.pair_pass, world = job.world_pass;
  pair.elapsed_s = world.elapsed_s = elapsed_s;
  auto run = [&](const OctetRun& octets, const Pass& pass) {
    if (octets.count > 0)
      kernel[octets.kind](schedule_.octets_from(octets.first), octets.count, points(), job.rows, pass);
  };
  bool alone = false;
  const auto& colours = schedule_.colours();
  for (std::size_t i = 0; i < colours.size(); ++i) {
    const Schedule::Colour& c = colours[i];
    // Colours too small to share follow each other on one member, without waiting.
    constexpr int kWorthSharing = 8;
    const bool share = !c.in_order && c.round.count + c.any.count >= kWorthSharing;
    if (share && alone) member.wait();
    alone = !share;
    if (share) {
      for (const OctetRun& octets : schedule_.share(member, i)) run(octets, pair);
      member.wait();
    } else if (member.first()) {
      run(c.round, pair);
      run(c.any, pair);
    }
  }
  if (alone) member.wait();
  for (const OctetRun& octets : schedule_.share(member, colours.size())) run(octets, world);
  member.wait();
}

}  // namespace smartsurf::world
