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

void put(float (&to)[3], const Vec3& from) {
  for (int i = 0; i < 3; ++i) to[i] = from[i];
}
void put(float (*to)[kLanes], int lane, const Vec3& from) {
  for (int i = 0; i < 3; ++i) to[i][lane] = from[i];
}
Vec3 take(const float (*from)[kLanes], int lane) { return {from[0][lane], from[1][lane], from[2][lane]}; }

// A body that a huge force flings away stays finite: it leaves the table and disturbs nobody else.
float limited(float speed) { return std::min(std::max(speed, -kTopSpeed), kTopSpeed); }

// What weight alone changes in so long a time; adding −0 changes nothing.
Motion fall(const Vec3& gravity, float h_s) {
  Motion m;
  put(m.velocity, h_s * (gravity + Vec3::Zero()));
  put(m.spin, Vec3::Constant(-0.0F));
  return m;
}

}  // namespace

struct Solver::Job {
  BodyStore& bodies;
  const Input& input;
  const Slabs& slabs;
  Range mine;  // the member's slabs
  Range own_rows;
  BodyRows rows;
  Pass pair_pass, world_pass;
  const KernelTable& kernels;
  bool bounces;
  bool all_round;
  Motion fall;  // of a substep

  ContactList& list(ContactKind kind) const { return is_pair(kind) ? input.pairs : input.world; }
  static bool is_pair(ContactKind kind) { return kind == kRoundPair || kind == kAnyPair; }
};

void Solver::step(BodyStore& bodies, const Input& input, const Member& member) {
  const Range mine = input.slabs.share(member);
  schedule_.build(bodies, input.pairs, input.pair_runs, input.world, input.world_runs, mine, member);
  member.alone([&] { make_room(input.slabs, member.members); });
  const float h_s = settings_.dt_s / static_cast<float>(settings_.substeps);
  const bool bounces =
      settings_.field_restitution > 0.0F ||
      std::any_of(bodies.grip.begin(), bodies.grip.end(), [](const Grip& g) { return g.restitution > 0; });
  Job job{bodies,
          input,
          input.slabs,
          mine,
          input.slabs.rows_of(mine),
          rows(),
          softness(h_s, kPairHz, settings_.substeps),
          softness(h_s, kWorldHz, settings_.substeps),
          contact_kernels(),
          bounces,
          std::find(bodies.round.begin(), bodies.round.end(), 0) == bodies.round.end(),
          fall(settings_.gravity, h_s)};
  work(job, member);
}

void Solver::make_room(const Slabs& slabs, int members) {
  const auto rows = static_cast<std::size_t>(slabs.rows());
  motion_.resize(rows);
  shift_.resize(rows);
  inertia_.resize(rows);
  start_.resize(rows);
  grip_.resize(rows);
  point_.resize(static_cast<std::size_t>(schedule_.points()));
  detail_.resize(point_.size());
  borders_.make_room(slabs.rows(), members);
}

void Solver::work(Job& job, const Member& member) {
  load_rows(job);
  borders_.clear(job.own_rows);
  member.meet();
  for (const OctetRun& run : schedule_.share(member))
    for (int i = run.first; i < run.first + run.count; ++i) fill(job, run.kind, i);
  member.meet();
  borders_.split(schedule_, member);
  begin_substep(job, true);
  member.arrive();
  const KernelTable& k = job.kernels;
  sweep(job, member, k.warm, 0.0F);
  const float h_s = job.pair_pass.h_s;
  for (int s = 0; s < settings_.substeps; ++s) {
    if (s > 0) {
      member.wait();
      begin_substep(job, false);
      member.arrive();
    }
    sweep(job, member, k.solve, static_cast<float>(s) * h_s);
    member.wait();
    advance(job);
    member.arrive();
    sweep(job, member, k.relax, 0.0F);
  }
  if (job.bounces) sweep(job, member, k.rebound, 0.0F);
  for (const OctetRun& run : schedule_.share(member))
    for (int i = run.first; i < run.first + run.count; ++i) read_back(job, run.kind, i);
  member.meet();
}

// ---- contacts into lanes, and back

void Solver::fill(Job& job, ContactKind kind, int index) {
  Octet& o = schedule_.clear_octet(index);
  set_bodies(job, o, index, kind);
  borders_.mark(o, job.own_rows);
  const ContactList& list = job.list(kind);
  auto for_lanes = [&](auto each) {
    for (int lane = 0; lane < o.count; ++lane)
      each(lane, list.manifolds[static_cast<std::size_t>(schedule_.manifold(index, lane))]);
  };
  auto fill_all = [&](const Parts& parts) {
    for_lanes([&](int lane, const Manifold& m) { fill_lane(job, o, lane, m, list.contacts, parts); });
  };
  clear_points(o);
  // Of spheres few passes read the details: what they leave alone is not touched.
  const bool round = kind == kRoundPair || kind == kRoundWorld, world = !Job::is_pair(kind);
  if (!round || job.bounces) {
    clear_details(o, true);
    fill_all({.points = true, .surface = world, .details = true});
  } else {
    fill_all({.points = true, .surface = false, .details = false});
    if (o.rolls || world) {
      clear_details(o, o.rolls);
      fill_all({.points = false, .surface = world, .details = o.rolls});
    }
  }
  if (!Job::is_pair(kind) && job.input.limited) fill_limits(o, index, list);
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
  for (std::size_t k = first; k < first + count; ++k) std::fill_n(point_[k].gap, kLanes, kWideGap);
}

void Solver::clear_details(const Octet& o, bool all) {
  const auto first = static_cast<std::size_t>(o.first), count = static_cast<std::size_t>(o.points);
  for (std::size_t k = first; k < first + count; ++k) {
    PointDetail& d = detail_[k];
    if (all)
      d = {};
    else
      std::memset(d.surface, 0, sizeof(d.surface));
  }
}

void Solver::fill_lane(const Job& job, Octet& o, int lane, const Manifold& m,
                       const std::vector<Contact>& contacts, const Parts& parts) {
  const std::vector<Vec3>& position = job.bodies.position;
  const Grip& a = grip_[static_cast<std::size_t>(o.a[lane])];
  for (int k = 0; k < m.count; ++k) {
    const Contact& c = contacts[static_cast<std::size_t>(m.first + k)];
    const Grip& b = m.b >= 0       ? grip_[static_cast<std::size_t>(o.b[lane])]
                    : c.other >= 0 ? grip_[static_cast<std::size_t>(job.slabs.row(c.other))]
                                   : field_;
    PointDetail& d = detail_[static_cast<std::size_t>(o.first + k)];
    if (parts.points) {
      Point& p = point_[static_cast<std::size_t>(o.first + k)];
      put(p.normal, lane, c.normal);
      p.radius_a[lane] = a.reach;
      p.radius_b[lane] = b.reach;
      p.gap[lane] = c.gap;
      p.push[lane] = c.push;
      put(p.drag, lane, c.drag);
      p.friction[lane] = a.friction_root * b.friction_root;
      o.rolls |= a.rolling_root * b.rolling_root > 0.0F;
    }
    if (parts.surface) {
      put(d.surface, lane, c.surface);
      d.surface_spin[lane] = c.surface_spin;
    }
    if (parts.details) {
      put(d.arm_a, lane, c.arm);
      if (m.b >= 0)
        put(d.arm_b, lane,
            position[static_cast<std::size_t>(m.a)] + c.arm - position[static_cast<std::size_t>(m.b)]);
      put(d.roll, lane, c.roll);
      d.rolling[lane] = a.rolling_root * b.rolling_root;
      d.restitution[lane] = std::max(a.restitution, b.restitution);
    }
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
  constexpr int kAhead = 8;  // rows: about what a trip to memory takes
  const BodyStore& b = job.bodies;
  for (int s = job.mine.begin; s < job.mine.end; ++s) {
    const Range rows = job.slabs.rows_of(s);
    for (int row = rows.begin; row < rows.end; ++row) {
      const auto to = static_cast<std::size_t>(row);
      const std::size_t from = job.slabs.body(row);
      if (row + kAhead < rows.end) b.fetch(job.slabs.body(row + kAhead));
      motion_[to] = b.motion[from];
      grip_[to] = b.grip[from];
      if (!job.all_round) inertia_[to] = b.inertia[from];
      shift_[to] = {};
    }
  }
}

// What forces add to the body's motion in a substep.
Motion Solver::pushed(const Job& job, int row) const {
  const std::size_t body = job.slabs.body(row);
  const surface::Wrench& w = job.bodies.wrench[body];
  const float h_s = job.pair_pass.h_s;
  Motion m = job.fall;
  put(m.velocity, h_s * (settings_.gravity + motion_[static_cast<std::size_t>(row)].inverse_mass * w.force));
  if (!w.torque.isZero(0.0F)) {
    const Inertia& q = job.bodies.inertia[body];
    put(m.spin, h_s * Vec3(Vec3(q.xx, q.xy, q.xz).dot(w.torque), Vec3(q.xy, q.yy, q.yz).dot(w.torque),
                           Vec3(q.xz, q.yz, q.zz).dot(w.torque)));
  }
  return m;
}

// Contacts act alike from substep to substep, because their normals and arms stay: what they gave the body in
// the last one, they give it again to start with.
void Solver::begin_substep(Job& job, bool first) {
  for_moving(job, [&](int row) {
    const Motion change = job.input.pushed ? pushed(job, row) : job.fall;
    Motion& m = motion_[static_cast<std::size_t>(row)];
    Motion& start = start_[static_cast<std::size_t>(row)];
    auto go_on = [first](float& speed, float& start_speed, float more) {
      const float gain = speed - start_speed;
      start_speed = limited(speed + more);
      speed = first ? start_speed : start_speed + gain;
    };
    for (int i = 0; i < 3; ++i) go_on(m.velocity[i], start.velocity[i], change.velocity[i]);
    for (int i = 0; i < 3; ++i) go_on(m.spin[i], start.spin[i], change.spin[i]);
  });
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

void Solver::hand_back(BodyStore& bodies, const Slabs& slabs, int row) const {
  const std::size_t to = slabs.body(row);
  bodies.motion[to] = motion_[static_cast<std::size_t>(row)];
  bodies.shift[to] = shift_[static_cast<std::size_t>(row)];
}

// ---- one pass over all contacts: pairs colour by colour, the world last, because nothing yields there

void Solver::sweep(Job& job, const Member& member, const Kernel (&kernel)[kContactKinds], float elapsed_s) {
  Pass pair = job.pair_pass, world = job.world_pass;
  pair.elapsed_s = world.elapsed_s = elapsed_s;
  const std::size_t colours = schedule_.colours().size();
  for (std::size_t i = 0; i <= colours; ++i) {
    auto run = [&](std::span<const OctetRun> runs) {
      for (const OctetRun& octets : runs)
        kernel[octets.kind](schedule_.octets_from(octets.first), octets.count, points(), job.rows,
                            i < colours ? pair : world);
    };
    member.wait();
    run(borders_.shared(member, i));
    member.arrive();
    run(borders_.own(member, i));
  }
}

}  // namespace smartsurf::world
