// The time step: its stages, in order.
#include <algorithm>
#include <array>
#include <span>
#include <type_traits>

#include "smartsurf/world/NativeEngine.h"
#include "smartsurf/world/field/ContinuousCollision.h"
#include "smartsurf/world/narrowphase/PairSweep.h"

namespace smartsurf::world {

struct NativeEngine::Stage {
  enum Threads {
    kCaller,     // the thread that called step(), before or after the team works
    kTeam,       // all members of the team at once
    kOneOfTeam,  // the caller, while the team waits
  };
  using E = NativeEngine;

  const char* name;
  Threads threads;
  void (*run)(E&, const Member&);
  bool (*applies)(const E&) = nullptr;  // null: always; stages of the team run only if any body is active

  static const Stage kAll[];

  constexpr bool is_of_team() const { return threads != kCaller; }

  // Calls a member function of the engine, with the member of the team if the function takes it.
  template <auto function>
  static void call(E& engine, const Member& member) {
    if constexpr (std::is_invocable_v<decltype(function), E&, const Member&>)
      (engine.*function)(member);
    else
      (engine.*function)();
  }
  static bool any_active(const E& e) { return !e.active_bodies_.empty(); }
  static bool none_active(const E& e) { return e.active_bodies_.empty(); }
  static bool writes_impulses(const E& e) { return !e.lacks_impulses_; }
  static bool any_asleep(const E& e) { return e.sleep_.any_asleep(); }
  static bool has_limits(const E& e) { return e.field_.has_force_limit(); }
  // Spheres have no faces that could continue each other.
  static bool any_flat_pair(const E& e) { return e.collision_.any_flat_pair(); }
  static bool may_stop(const E& e) { return e.collision_.any_swept() || !e.joints_.empty(); }
  static bool has_soft_tips(const E& e) { return !e.field_.yielding.empty(); }
  static bool has_skin(const E& e) { return e.field_.has_skin(); }
  static bool has_elastic_skin(const E& e) { return e.field_.skin.is_elastic; }
  // Tips under a skin take no part in contacts.
  static bool has_free_tips(const E& e) { return e.field_.has_offset() && !e.field_.has_skin(); }
};

// clang-format off
constexpr NativeEngine::Stage NativeEngine::Stage::kAll[] = {
    // ---- inputs
    {"read field",             kCaller,    call<&E::read_field>},
    {"hold jammed cells",      kCaller,    call<&E::hold_jammed_cells>},
    {"apply forces",           kCaller,    call<&E::apply_forces>},
    {"predict skin",           kCaller,    call<&E::predict_skin>,           has_elastic_skin},
    {"wake disturbed bodies",  kCaller,    call<&E::wake_disturbed>,         any_asleep},
    {"wake hit sleepers",      kCaller,    call<&E::wake_hit_sleepers>,      any_asleep},
    {"restore contacts",       kCaller,    call<&E::restore_contacts>},
    {"collect active bodies",  kCaller,    call<&E::collect_active_bodies>},
    {"clear contacts",         kCaller,    call<&E::clear_contacts>,         none_active},
    // ---- contacts
    {"broad phase",            kTeam,      call<&E::update_broadphase>},
    {"narrow phase",           kTeam,      call<&E::find_contacts>},
    {"correct seams",          kTeam,      call<&E::correct_seams>,          any_flat_pair},
    {"share force limits",     kOneOfTeam, call<&E::share_force_limits>,     has_limits},
    {"collect tip contacts",   kOneOfTeam, call<&E::collect_tip_contacts>,   has_soft_tips},
    {"collect skin contacts",  kOneOfTeam, call<&E::collect_skin_contacts>,  has_skin},
    // ---- motion
    {"solve",                  kTeam,      call<&E::solve>},
    {"stop at bodies",         kTeam,      call<&E::stop_at_bodies>,         may_stop},
    {"finalize bodies",        kTeam,      call<&E::finalize_bodies>},
    {"store tips and skin",    kCaller,    call<&E::store_tips_and_skin>,    any_active},
    {"yield overloaded cells", kCaller,    call<&E::yield_overloaded_cells>, any_active},
    {"relieve jams",           kCaller,    call<&E::relieve_jams>,           any_active},
    {"sleep",                  kCaller,    call<&E::put_to_sleep>,           any_active},
    {"advance skin",           kCaller,    call<&E::advance_skin>,           has_elastic_skin},
    // ---- outputs
    {"write cell impulses",    kCaller,    call<&E::write_cell_impulses>,    writes_impulses},
    {"write tip impulses",     kCaller,    call<&E::write_tip_impulses>,     has_free_tips},
    {"write skin impulses",    kCaller,    call<&E::write_skin_impulses>,    has_skin},
    {"return lowered speeds",  kCaller,    call<&E::return_lowered_speeds>},
    {"clear forces",           kCaller,    call<&E::clear_forces>},
};
// clang-format on

// Calls the stages [first, end) of the table, which the compiler knows: small worlds spend their steps on
// calls.
template <std::size_t first, std::size_t end>
void NativeEngine::run_stages(const Member& member) {
  if constexpr (first < end) {
    constexpr const Stage& stage = Stage::kAll[first];
    if (stage.applies == nullptr || stage.applies(*this)) {
      if constexpr (stage.threads == Stage::kOneOfTeam)
        member.single([&] { stage.run(*this, member); });
      else
        stage.run(*this, member);
    }
    if (stage.is_of_team() && is_overloaded()) return;
    run_stages<first + 1, end>(member);
  }
}

// The stages of the team follow each other and run in one fork, because waking threads costs more than a
// barrier.
void NativeEngine::step() {
  constexpr std::span<const Stage> kStages(Stage::kAll);
  constexpr auto is_of_team = [](const Stage& stage) { return stage.is_of_team(); };
  constexpr std::size_t kBegin = std::ranges::find_if(kStages, is_of_team) - kStages.begin();
  constexpr std::size_t kEnd =
      std::ranges::find_if_not(kStages.subspan(kBegin), is_of_team) - kStages.begin();
  static_assert(std::ranges::none_of(kStages.subspan(kEnd), is_of_team));
  solver_ = &Solver::of_this_thread(settings_);
  lacks_loads_ = lacks_impulses_ = writes_when_asked_;
  team_.run(false, [&](const Member& member) { run_stages<0, kBegin>(member); });
  if (!active_bodies_.empty()) {
    // A body with joints takes as long as several others.
    constexpr std::size_t kJointedWeight = 4;
    std::size_t work = active_bodies_.size();
    if (!joints_.empty())
      for (const auto i : active_bodies_) work += bodies_.is_jointed[i] != 0 ? kJointedWeight - 1 : 0;
    team_.run(work >= kMinParallelBodies, [&](const Member& member) { run_stages<kBegin, kEnd>(member); });
    if (is_overloaded()) {
      lacks_loads_ = lacks_impulses_ = false;
      return;
    }
  }
  team_.run(false, [&](const Member& member) { run_stages<kEnd, kStages.size()>(member); });
}

// ---- inputs

void NativeEngine::read_field() {
  const bool moves =
      scene_field_.max_speed != 0.0F || scene_field_.has_force_limit() || !scene_field_.yielding.empty();
  field_changed_ |= moves || field_moved_;
  field_moved_ = moves;
  lowered_speeds_ = field_.has_force_limit();
  if (!unit_.is_one()) unit_.update_motion(scene_field_, field_copy_, pool_);
  field_.update_column_height();
}

void NativeEngine::hold_jammed_cells() { lowered_speeds_ |= jam_relief_.hold_cells(field_); }

// Wrenches come in scene units and act about the origin.
void NativeEngine::apply_forces() {
  if (has_wrenches_ && !unit_.is_one())
    for (surface::Wrench& w : bodies_.wrench) w = unit_.to_world(w);
  if (has_wrenches_ && bodies_.has_offsets)
    for (std::size_t i = 0; i < bodies_.wrench.size(); ++i)
      bodies_.wrench[i].torque += bodies_.origin_offset[i].cross(bodies_.wrench[i].force);
  has_wrenches_ |= !timed_forces_.empty();
  for (TimedForce& f : timed_forces_) {
    const int i = bodies_.find(f.id);
    const Vec3 force = static_cast<float>(f.time_left.take()) * f.force;
    bodies_.wrench[i].force += force;
    bodies_.wrench[i].torque += Vec3(bodies_.orientation[i] * f.local_point).cross(force);
  }
  std::erase_if(timed_forces_, [](const TimedForce& f) { return f.time_left.is_over(); });
}

void NativeEngine::predict_skin() { elastic_skin_.begin(field_.skin); }

void NativeEngine::wake_disturbed() {
  if (has_wrenches_) sleep_.wake_forced(bodies_);
  sleep_.wake_on_moving_cells(bodies_);
}

// Wakes sleepers within reach of a fast body, so that the collision moves them.
void NativeEngine::wake_hit_sleepers() {
  collision_.update_sleepers(bodies_, sleep_.set_version());
  hit_sleepers_.clear();
  for (const std::int32_t i : collision_.bodies_in_grid())
    if (bodies_.is_active(i) && Sleep::is_fast(bodies_, i))
      collision_.for_each_sleeper_in_reach(
          bodies_, i, [this](std::int32_t sleeper) { hit_sleepers_.push_back(sleeper); });
  for (const std::int32_t i : hit_sleepers_) sleep_.wake_island(bodies_, i);
}

void NativeEngine::restore_contacts() {
  sleep_.restore_contacts(pair_contacts_, static_contacts_, collision_.previous_supports());
  collision_.update_sleepers(bodies_, sleep_.set_version());
}

void NativeEngine::collect_active_bodies() {
  if (active_version_ == sleep_.set_version()) return;
  active_version_ = sleep_.set_version();
  active_bodies_.clear();
  for (std::int32_t i = 0; i < bodies_.size(); ++i)
    if (bodies_.is_active(i)) active_bodies_.push_back(i);
}

void NativeEngine::clear_contacts() {
  pair_contacts_.clear();
  static_contacts_.clear();
  cell_impulses_.clear();
  tips_.clear();
  skin_points_.clear();
  collision_.clear_supports();
}

// ---- contacts

void NativeEngine::update_broadphase(const Member& member) { collision_.update_broadphase(bodies_, member); }

void NativeEngine::find_contacts(const Member& member) {
  collision_.find_contacts(bodies_, pair_contacts_, static_contacts_, member);
  if (!member.is_caller()) return;
  cell_impulses_.resize(static_contacts_.contacts.size());
  stops_.clear();  // "stop at bodies" may be skipped
}

void NativeEngine::correct_seams(const Member& member) {
  seams_.run(bodies_, pair_contacts_, static_contacts_, collision_.partition().bodies_of(member), member);
}

void NativeEngine::share_force_limits() {
  force_limits_.distribute_limits(field_, settings_.dt_s, settings_.substeps, static_contacts_);
}

void NativeEngine::collect_tip_contacts() { tips_.collect(field_, static_contacts_); }

surface::Skin::Location NativeEngine::location_on_skin(const Manifold& m, const Contact& c) const {
  const Vec3 point = bodies_.position[m.a] + c.anchor;
  return field_.skin.locate(point.x(), point.y());
}

void NativeEngine::collect_skin_contacts() {
  skin_points_.clear();
  for (const Manifold& m : static_contacts_.manifolds)
    for (std::int32_t k = m.first; k < m.first + m.count; ++k)
      if (const Contact& c = static_contacts_.contacts[k]; c.touches_skin())
        skin_points_.push_back({k, m.a, location_on_skin(m, c)});
  if (field_.skin.is_elastic) elastic_skin_.collect(field_.skin, bodies_, static_contacts_);
}

// ---- motion

void NativeEngine::solve(const Member& member) {
  const ImpactSolver::HasRoom has_room = [this](std::int32_t body, std::int32_t partner, float reach) {
    return collision_.has_room(bodies_, body, partner, reach);
  };
  solver_->step(bodies_,
                {.partition = collision_.partition(),
                 .pair_contacts = pair_contacts_,
                 .static_contacts = static_contacts_,
                 .pair_ranges = collision_.pair_ranges(),
                 .static_ranges = collision_.static_ranges(),
                 .supports = collision_.supports(),
                 .cell_limits = force_limits_.limits(),
                 .has_wrenches = has_wrenches_,
                 .joints = joints_,
                 .tips = tips_,
                 .skin = elastic_skin_,
                 .has_room = has_room,
                 .has_surface_spin = !field_.surface_spin.empty(),
                 .finds_loads = !lacks_loads_,
                 .min_jam_depth = jam_relief_.min_depth()},
                member);
}

// A body that was swept against others may still enter one: once it has hit something it moves on another
// path, and a corner that hits makes it spin. Then its motion ends there, and the next step finds the
// contact.
void NativeEngine::stop_at_bodies(const Member& member) {
  std::vector<Stop>& own = stops_of_members_[member.index];
  own.clear();
  const SpatialPartition& partition = collision_.partition();
  collision_.for_each_swept_pair(member, [&](std::size_t a, std::size_t b) {
    // Free rotation changes the axis of rotation, so the body does not turn about its spin.
    const auto motion_of = [&](std::size_t i) {
      if (!bodies_.is_active(i)) return DeltaPose{};
      const int row = partition.row(static_cast<std::int32_t>(i));
      DeltaPose motion = solver_->motion(row);
      if (!bodies_.is_sphere[i] && !bodies_.is_jointed[i])
        Eigen::Map<Vec3>(motion.rotation) =
            bodies_.turn_in_step(i, solver_->velocity(row), motion, settings_.dt_s);
      return motion;
    };
    const DeltaPose motion_a = motion_of(a), motion_b = motion_of(b);
    const PairSweep sweep(bodies_, a, b, settings_.dt_s, motion_a, motion_b);
    // Bodies that move less do not pass each other, and their contacts push them apart.
    if (sweep.travel() < collision_.thinner_width(a, b)) return;
    const PairSweep::Overlap overlap = sweep.find_overlap();
    if (overlap.time_s != PairSweep::kNever)
      for (const auto& [i, motion] : {std::pair(a, motion_a), std::pair(b, motion_b)})
        if (bodies_.is_active(i))
          own.push_back({static_cast<std::int32_t>(i), overlap.time_s / settings_.dt_s, motion});
    if (!overlap.are_pierced) return;
    for (const Stop& s : slow_down({static_cast<std::int32_t>(a), static_cast<std::int32_t>(b)},
                                   collision_.thinner_width(a, b) / sweep.travel()))
      if (bodies_.is_active(s.body)) own.push_back(s);
  });
  member.single([&] {
    for (int i = 0; i < member.member_count; ++i) {
      const std::vector<Stop>& found = stops_of_members_[i];
      stops_.insert(stops_.end(), found.begin(), found.end());
    }
    if (!joints_.empty()) stop_jointed();
    std::ranges::sort(stops_, {}, [](const Stop& s) { return std::pair(s.body, s.fraction); });
    const auto later = std::ranges::unique(stops_, {}, &Stop::body);
    stops_.erase(later.begin(), later.end());
    for (const Stop& s : stops_) {
      const int row = partition.row(s.body);
      solver_->set_motion(row, s.motion, s.fraction);
      if (s.slows) solver_->set_velocity(row, s.velocity, s.angular_velocity);
    }
  });
}

// Bodies that have pierced each other move no farther through each other than the thinner one's width, and
// keep the velocities that this leaves them: as contacts do not know on which side they are, nothing else
// would slow what falls or flies through. The motion of both together stays as it is.
std::array<NativeEngine::Stop, 2> NativeEngine::slow_down(std::array<std::int32_t, 2> pair,
                                                          float fraction) const {
  std::array<Stop, 2> stops;
  Vec3 common_motion(0, 0, 0), common_velocity(0, 0, 0);
  const auto row_of = [&](std::int32_t body) { return collision_.partition().row(body); };
  const bool is_held = !bodies_.is_active(pair[0]) || !bodies_.is_active(pair[1]);
  for (std::size_t k = 0; k < 2; ++k) {
    stops[k] = {pair[k], fraction,
                bodies_.is_active(pair[k]) ? solver_->motion(row_of(pair[k])) : DeltaPose{}};
    if (is_held) continue;
    const float share = bodies_.mass[pair[k]] / (bodies_.mass[pair[0]] + bodies_.mass[pair[1]]);
    common_motion += share * Vec3(stops[k].motion.translation);
    common_velocity += share * Vec3(solver_->velocity(row_of(pair[k])).velocity);
  }
  for (Stop& s : stops) {
    if (!bodies_.is_active(s.body) || bodies_.is_jointed[s.body]) continue;
    const BodyVelocity& v = solver_->velocity(row_of(s.body));
    s.slows = true;
    s.velocity = common_velocity + fraction * (Vec3(v.velocity) - common_velocity);
    s.angular_velocity = fraction * Vec3(v.angular_velocity);
    Eigen::Map<Vec3>(s.motion.translation) += (1.0F / fraction - 1.0F) * common_motion;
  }
  return stops;
}

// Bodies that joints connect stop together, where the first of them meets the field or another body: one that
// stopped alone would be off its joints.
void NativeEngine::stop_jointed() {
  joints_.for_each_jointed([&](std::int32_t body) {
    const float fraction = fraction_until_impact(collision_.field_collider(), bodies_, body,
                                                 solver_->motion(collision_.partition().row(body)));
    if (fraction < 1.0F) stops_.push_back({body, fraction, {}});
  });
  const auto is_jointed = [&](const Stop& s) { return bodies_.is_jointed[s.body] != 0; };
  for (const Stop& s : stops_)
    if (is_jointed(s)) joints_.end_early(s.body, s.fraction);
  std::erase_if(stops_, is_jointed);
  solver_->end_motion(joints_, bodies_);
}

// Moves the bodies by what the solver found, and collects what depends on one body or contact alone.
void NativeEngine::finalize_bodies(const Member& member) {
  constexpr int kPrefetchDistance = 8;  // in rows: about one memory latency
  const SpatialPartition& partition = collision_.partition();
  const IndexRange own_slabs = partition.share(member);
  std::array<BodyStore::Rotating, kLanes> rotating;  // non-spheres collected for one SIMD batch
  std::size_t count = 0;
  auto flush_rotations = [&] {
    const auto batch = std::span(rotating).first(count);
    if (count > 0) bodies_.integrate_poses(batch);
    for (const BodyStore::Rotating& r : batch) sleep_.update_sleep_timer(bodies_, r.body);
    count = 0;
  };
  for (int s = own_slabs.begin; s < own_slabs.end; ++s) {
    const IndexRange rows = partition.active_rows_of(s);
    for (int row = rows.begin; row < rows.end; ++row) {
      const std::size_t i = partition.body(row);
      if (row + kPrefetchDistance < rows.end) {
        const std::size_t ahead = partition.body(row + kPrefetchDistance);
        bodies_.prefetch(ahead);
        bodies_.prefetch_rotation(ahead);
      }
      solver_->store_body(bodies_, partition, row);
      if (bodies_.is_sphere[i]) {
        bodies_.integrate_pose(i);
        sleep_.update_sleep_timer(bodies_, i);
      } else {
        // A clipped body must end in the pose in which it was found to touch, one with joints in that where
        // they hold.
        const bool is_clipped =
            (!bodies_.is_jointed[i] && clip_to_time_of_impact(collision_.field_collider(), bodies_, i)) ||
            std::ranges::binary_search(stops_, static_cast<std::int32_t>(i), {}, &Stop::body);
        rotating[count++] = {i, is_clipped || bodies_.is_jointed[i] ? 0.0F : settings_.dt_s};
        if (count == rotating.size()) flush_rotations();
      }
    }
  }
  flush_rotations();
  const IndexRange own_static = collision_.static_ranges().of(own_slabs);
  sleep_.reset_timers_on_moving_cells(bodies_, static_contacts_, own_static);
  record_cell_impulses(own_static);
  if (bodies_.non_spheres == 0) return;  // only others have support patches
  for (int s = own_slabs.begin; s < own_slabs.end; ++s)
    sleep_.reset_timers_on_patches(bodies_, collision_.supports()[s]);
}

// Cell impulses have an array of their own, because write_cell_impulses() reads all of them on one thread:
// the contacts stay in the caches of the members that own them.
void NativeEngine::record_cell_impulses(IndexRange manifolds) {
  for (int i = manifolds.begin; i < manifolds.end; ++i) {
    const Manifold& m = static_contacts_.manifolds[i];
    for (int k = m.first; k < m.first + m.count; ++k) {
      const Contact& c = static_contacts_.contacts[k];
      const bool loads_cell = c.loads_cell() && c.total_normal_impulse != 0.0F;
      cell_impulses_[k] = {loads_cell ? c.feature_id : -1, c.total_normal_impulse};
    }
  }
}

void NativeEngine::store_tips_and_skin() {
  tips_.store(field_, static_contacts_, settings_.dt_s);
  elastic_skin_.store(static_contacts_);
  if (!tips_.empty() || field_.skin.is_elastic)
    record_cell_impulses({0, static_cast<int>(static_contacts_.manifolds.size())});
  if (unit_.is_one()) return;
  for (const std::int32_t cell : tips_.cells()) unit_.return_yielding_tip(field_, cell, scene_field_);
}

void NativeEngine::yield_overloaded_cells() {
  force_limits_.yield_overloaded_cells(bodies_, static_contacts_, settings_.dt_s, field_);
}

void NativeEngine::relieve_jams() {
  const auto stall_cells = [this](std::span<const JammedBody> jammed) {
    lowered_speeds_ |=
        jam_relief_.stall_cells(jammed, static_contacts_, collision_.supports(), bodies_, field_);
  };
  // All members' lists at once: a body may be in several of them, which depends on the number of threads.
  jammed_bodies_.clear();
  for (const std::vector<JammedBody>& jammed : solver_->jammed_bodies())
    jammed_bodies_.insert(jammed_bodies_.end(), jammed.begin(), jammed.end());
  stall_cells(jammed_bodies_);
  strained_bodies_.clear();
  joints_.find_strained(bodies_, jam_relief_.min_depth(), strained_bodies_);
  if (strained_bodies_.empty()) return;
  jam_relief_.spread(strained_bodies_, pair_contacts_, bodies_);
  stall_cells(strained_bodies_);
}

// Joints pull together what is apart without giving it a velocity.
void NativeEngine::keep_strained_awake() {
  constexpr float kMaxRestStrain = 0.02F;  // u
  strained_bodies_.clear();
  joints_.find_strained(bodies_, kMaxRestStrain, strained_bodies_);
  for (const JammedBody& strained : strained_bodies_) bodies_.sleep_timer_s[strained.body] = 0.0F;
}

void NativeEngine::put_to_sleep() {
  keep_strained_awake();
  sleep_.update_sleeping_set(
      bodies_, active_bodies_, pair_contacts_, static_contacts_, collision_.supports(),
      [this] { find_loads(); }, solver_->direct_islands());
}

void NativeEngine::advance_skin() {
  elastic_skin_.advance(field_.skin);
  if (!unit_.is_one()) unit_.return_skin(field_.skin, scene_field_.skin);
}

// ---- outputs

// Sleepers keep the impulses that they had when they fell asleep.
void NativeEngine::update_sleeper_impulses() {
  sleeper_impulse_version_ = sleep_.contacts_version();
  sleeper_impulse_.resize(scene_field_.impulse.size(), 0.0F);
  for (const std::int32_t cell : sleeper_cells_) sleeper_impulse_[cell] = scene_field_.impulse[cell] = 0.0F;
  sleeper_cells_.clear();
  const auto add_load = [this](std::int32_t cell, float impulse) {
    sleeper_impulse_[cell] += unit_.to_scene(impulse);
    sleeper_cells_.push_back(cell);
  };
  sleep_.contacts().for_each_static([&](const Manifold&, std::span<const Contact> contacts) {
    for (const Contact& c : contacts)
      if (c.loads_cell()) add_load(c.feature_id, c.total_normal_impulse);
  });
  sleep_.contacts().for_each_loaded_sample(
      [&](const SupportPatch&, const SupportSamples& s, Index i) { add_load(s.cell[i], s.load[i]); });
  for (const std::int32_t cell : sleeper_cells_) scene_field_.impulse[cell] = sleeper_impulse_[cell];
  // Bodies that fell asleep in this step count as sleepers.
  for (const Manifold& m : static_contacts_.manifolds)
    for (int k = m.first; bodies_.asleep[m.a] && k < m.first + m.count; ++k) cell_impulses_[k].cell = -1;
}

void NativeEngine::write_cell_impulses() {
  if (sleeper_impulse_version_ != sleep_.contacts_version()) update_sleeper_impulses();
  for (const std::int32_t cell : loaded_cells_)
    scene_field_.impulse[cell] = sleeper_impulse_.empty() ? 0.0F : sleeper_impulse_[cell];
  loaded_cells_.clear();
  const auto add_load = [this](std::int32_t cell, float impulse) {
    scene_field_.impulse[cell] += unit_.to_scene(impulse);
    loaded_cells_.push_back(cell);
  };
  // In the order of the manifolds, which does not depend on how the contacts were found.
  for (const Manifold& m : static_contacts_.manifolds)
    for (const Load& entry : std::span(cell_impulses_).subspan(m.first, m.count))
      if (entry.cell >= 0) add_load(entry.cell, entry.impulse);
  for_each_awake_support(
      [&](const SupportPatch&, const SupportSamples& s, Index i) { add_load(s.cell[i], s.load[i]); });
}

// The friction of a step is taken as that of its last substep.
void NativeEngine::write_tip_impulses() {
  std::vector<Vec3>& impulse = scene_field_.tip_impulse;
  for (const std::int32_t cell : loaded_tips_) impulse[cell].setZero();
  loaded_tips_.clear();
  const auto substeps = static_cast<float>(settings_.substeps);
  const auto add_loads = [&](const Manifold&, std::span<const Contact> contacts) {
    for (const Contact& c : contacts) {
      const std::int32_t cell = c.feature_id;
      if (c.total_normal_impulse == 0.0F || !c.loads_cell() || field_.is_column(cell) ||
          !field_.tip_at(cell).moves_sideways())
        continue;
      impulse[cell] -=
          unit_.to_scene(Vec3(c.total_normal_impulse * c.normal + substeps * c.friction_impulse));
      loaded_tips_.push_back(cell);
    }
  };
  for (const Manifold& m : static_contacts_.manifolds)
    if (!bodies_.asleep[m.a]) add_loads(m, static_contacts_.contacts_of(m));
  sleep_.contacts().for_each_static(add_loads);
}

// The friction of a step on a kinematic skin is taken as in write_tip_impulses().
void NativeEngine::write_skin_impulses() {
  std::vector<float>& impulse = scene_field_.skin.impulse;
  std::ranges::fill(impulse, 0.0F);
  const auto substeps = static_cast<float>(settings_.substeps);
  const auto add_load = [&](const surface::Skin::Location& at, float load) {
    for (int i = 0; i < 3; ++i) impulse[at.node[i]] += unit_.to_scene(at.weight[i] * load);
  };
  const auto load_of = [substeps](const Contact& c) {
    return c.total_normal_impulse * c.normal.z() + substeps * c.friction_impulse.z();
  };
  for (std::size_t i = 0; i < skin_points_.size(); ++i) {
    const SkinPoint& p = skin_points_[i];
    if (bodies_.asleep[p.body]) continue;
    add_load(p.at, field_.skin.is_elastic ? elastic_skin_.impulse_on_body(i)
                                          : load_of(static_contacts_.contacts[p.contact]));
  }
  sleep_.contacts().for_each_static([&](const Manifold& m, std::span<const Contact> contacts) {
    for (const Contact& c : contacts)
      if (c.touches_skin()) add_load(location_on_skin(m, c), load_of(c));
  });
}

void NativeEngine::return_lowered_speeds() {
  if (lowered_speeds_ && !unit_.is_one()) unit_.return_lowered_speeds(field_copy_, scene_field_);
}

void NativeEngine::clear_forces() {
  if (has_wrenches_) std::ranges::fill(bodies_.wrench, surface::Wrench{});
  has_wrenches_ = false;
}

}  // namespace smartsurf::world
