#include "smartsurf/world/Sleep.h"

#include <algorithm>
#include <cmath>

#include "smartsurf/world/simd/Simd4.h"

namespace smartsurf::world {
namespace {

constexpr float kMaxSleepSpeed = 0.06F;  // upper bound of the speed of any point of a resting body, u/s
// The same for bodies with joints: a pendulum in its lowest point hardly accelerates.
constexpr float kMaxJointedSleepSpeed = 0.003F;
constexpr float kTimeToSleep_s = 0.5F;  // a body must rest this long before it falls asleep
// Upper bound of the mean acceleration of any point of a resting body over that time, and on elastic tops
// over each step of it, u/s².
constexpr float kMaxSleepAcceleration = 0.01F;
constexpr float kWakeIslandSpeed = 0.6F;  // a faster body wakes the whole island that it hits, u/s

// Upper bound of the speed of any point of the body.
float max_point_speed(const BodyStore& b, std::size_t i) {
  return b.velocity(i).norm() + b.angular_velocity(i).norm() * b.bounding_radius[i];
}

// True if the mean velocity of any point in the second half of kTimeToSleep_s differs too much from that in
// the first. Means are compared, because an object under a heavy load may jitter without going anywhere.
bool accelerates(const BodyStore& b, std::size_t i, float dt_s, float scale) {
  const RestMotion& m = b.rest_motion[i];
  const float change = (m.velocity.norm() + m.angular_velocity.norm() * b.bounding_radius[i]) * dt_s;
  constexpr float kHalf_s = 0.5F * kTimeToSleep_s;
  return change > scale * kMaxSleepAcceleration * kHalf_s * kHalf_s;
}

// True if the loads of elastic tops do not balance the body in this step: they may swing about its weight
// with a mean velocity of 0, but do not jitter.
bool swings(const BodyStore& b, const SupportPatch& p, float dt_s, float scale) {
  const Vec3 v = b.velocity(p.body), w = b.angular_velocity(p.body),
             start = Eigen::Map<const Eigen::Vector3d>(p.start_motion).cast<float>();
  const float change = std::abs(v.z() - start.x()) +
                       length_of(w.y() + start.y(), w.x() - start.z()) * b.bounding_radius[p.body];
  return change > scale * kMaxSleepAcceleration * dt_s;
}

bool any_nonzero(std::span<const float> values) {
  const auto count = static_cast<int>(values.size());
  if (count < kSimd4Width) return std::ranges::any_of(values, [](float v) { return v != 0.0F; });
  Int4 any{};
  for_each_simd4(count, [&](int i) { any |= load4(&values[i]) != 0.0F; });
  return (any[0] | any[1] | any[2] | any[3]) != 0;
}

}  // namespace

bool Sleep::is_fast(const BodyStore& b, std::size_t i) { return max_point_speed(b, i) > kWakeIslandSpeed; }

// ---- waking

void Sleep::wake(BodyStore& b, std::size_t i) {
  b.sleep_timer_s[i] = 0.0F;
  if (!b.asleep[i]) return;
  // Wakes also the bodies connected by joints or lying on it: a sleeper among them would hold them like the
  // table, and would not press on them.
  std::size_t reached = woken_.size();
  wake_alone(b, static_cast<std::int32_t>(i));
  for (; reached < woken_.size(); ++reached) {
    const std::int32_t body = woken_[reached];
    b.for_each_linked(body, [&](std::int32_t other) { wake_alone(b, other); });
    contacts_.for_each_pair_of(body, [&](const Manifold& m, std::span<const Contact> contacts) {
      const auto [above, below] = stacked(m, contacts.front());
      if (below == body) wake_alone(b, above);
    });
  }
}

Sleep::Stacked Sleep::stacked(const Manifold& m, const Contact& first) const {
  constexpr float kUpward = 0.3F;
  const float up = first.normal.dot(up_);
  if (std::abs(up) < kUpward) return {};
  return up > 0.0F ? Stacked{m.a, m.b} : Stacked{m.b, m.a};
}

void Sleep::wake_alone(BodyStore& b, std::int32_t i) {
  if (!b.asleep[i]) return;
  b.sleep_timer_s[i] = 0.0F;
  b.asleep[i] = 0;
  b.body_velocity[i].inverse_mass = 1.0F / b.mass[i];
  if (b.is_sphere[i]) b.body_velocity[i].inverse_inertia = b.inverse_inertia_of_sphere(i);
  b.update_axes(i);
  --sleeping_count_;
  ++set_version_, ++contacts_version_;
  woken_.push_back(i);
}

void Sleep::wake_island(BodyStore& b, std::size_t body) {
  // Flood fill over the contact graph.
  std::size_t reached = woken_.size();
  wake(b, body);
  for (; reached < woken_.size(); ++reached)
    contacts_.for_each_neighbour(woken_[reached], [&](std::int32_t other) {
      if (b.asleep[other]) wake(b, other);
    });
}

void Sleep::wake_with_neighbours(BodyStore& b, std::size_t body, const ContactList& pair_contacts,
                                 const ContactList& static_contacts) {
  const auto index = static_cast<std::int32_t>(body);
  // Contacts with a static body are found from the other body's side, which must be awake for that.
  if (b.is_static(body))
    for (std::size_t i = 0; i < b.asleep.size(); ++i) wake(b, i);
  wake_island(b, body);
  for (const Manifold& m : pair_contacts.manifolds)
    if (m.a == index || m.b == index) wake_island(b, m.a == index ? m.b : m.a);
  for (const Manifold& m : static_contacts.manifolds)
    for (const Contact& c : static_contacts.contacts_of(m))
      if (c.partner == Partner{index}) wake_island(b, m.a);
  b.for_each_linked(body, [&](std::int32_t other) { wake_island(b, other); });
  placed_.push_back(index);
}

void Sleep::wake_forced(BodyStore& b) {
  for (std::size_t i = 0; i < b.wrench.size(); ++i)
    if (!b.wrench[i].is_zero() && !b.is_static(i)) wake_island(b, i);
}

void Sleep::wake_on_moving_cells(BodyStore& b) {
  if (!any_asleep() || (field_.max_speed == 0.0F && !field_.has_surface_velocity())) return;
  // With few sleepers on many cells it is cheaper to look at their cells alone.
  constexpr int kTypicalCellsPerSleeper = 64;
  const bool few_sleepers =
      field_.is_rectangular() && sleeping_count_ < field_.cells() / kTypicalCellsPerSleeper;
  moving_columns_.assign(field_.rows, {0, field_.columns});
  bool any_moves = few_sleepers;
  for (std::size_t r = 0; r < moving_columns_.size() && !few_sleepers; ++r) {
    moving_columns_[r] = find_moving_columns(static_cast<int>(r));
    any_moves |= moving_columns_[r].begin < moving_columns_[r].end;
  }
  if (!any_moves && !field_.has_skin()) return;
  // In a free layout rows and columns say nothing about positions, so any motion may be near. An actuator
  // moves a skin beyond the cells near the actuator.
  const bool wake_all =
      (!field_.is_rectangular() && any_moves) || (field_.has_skin() && field_.skin.supports_move);
  for (const std::int32_t i : sleepers(b))
    if (wake_all || any_cell_moves(cells_near_sleeper_[i])) wake(b, i);
}

const std::vector<std::int32_t>& Sleep::sleepers(const BodyStore& b) {
  if (has_sleeper_list_ && sleeper_version_ == set_version_) return sleepers_;
  sleepers_.clear();
  for (std::int32_t i = 0; i < b.size(); ++i)
    if (b.asleep[i]) sleepers_.push_back(i);
  sleeper_version_ = set_version_;
  has_sleeper_list_ = true;
  return sleepers_;
}

bool Sleep::cell_moves(Index i) const {
  if (field_.speed[i] != 0.0F) return true;
  if (field_.has_tilt() && !field_.tilt_rate[i].is_zero()) return true;
  if (field_.has_offset() && !field_.offset_rate[i].isZero(0.0F)) return true;
  if (field_.has_surface_velocity() &&
      (field_.surface_velocity_x[i] != 0.0F || field_.surface_velocity_y[i] != 0.0F))
    return true;
  return !field_.surface_spin.empty() && field_.surface_spin[i] != 0.0F;
}

bool Sleep::any_moves(std::size_t first, std::size_t count) const {
  const auto any_of = [&](const std::vector<float>& values) {
    return !values.empty() && any_nonzero(std::span(values).subspan(first, count));
  };
  if (any_of(field_.speed) || any_of(field_.surface_velocity_x) || any_of(field_.surface_velocity_y) ||
      any_of(field_.surface_spin))
    return true;
  for (std::size_t i = first; (field_.has_tilt() || field_.has_offset()) && i < first + count; ++i)
    if (cell_moves(i)) return true;
  return false;
}

// Columns of a row outside of which no cell moves.
IndexRange Sleep::find_moving_columns(int row) const {
  constexpr int kBlock = 16;  // columns looked at together
  IndexRange moving{field_.columns, 0};
  for (int begin = 0; begin < field_.columns; begin += kBlock) {
    const int end = std::min(begin + kBlock, field_.columns);
    if (!any_moves(field_.index(row, begin), end - begin)) continue;
    moving = {std::min(moving.begin, begin), end};
  }
  return moving;
}

bool Sleep::any_cell_moves(const CellRect& cells) const {
  for (int r = cells.row_begin; r < cells.row_end; ++r) {
    const IndexRange moving = moving_columns_[r];
    const int end = std::min(cells.column_end, moving.end);
    for (int c = std::max(cells.column_begin, moving.begin); c < end; ++c)
      if (cell_moves(field_.index(r, c))) return true;
  }
  return false;
}

void Sleep::restore_contacts(ContactList& pair_contacts, ContactList& static_contacts,
                             SupportPatches& supports) {
  if (woken_.empty()) return;
  ++contacts_version_;
  for (const std::int32_t i : woken_) contacts_.take_out(i, pair_contacts, static_contacts, supports);
  woken_.clear();
}

// ---- falling asleep

bool Sleep::touches_moving_cell(const Contact& c) const {
  if (c.partner == Partner::kElasticTop) return false;  // SupportPatch::moves decides
  return c.gives_way() || (c.loads_cell() && (!c.surface_velocity.isZero(0.0F) || c.surface_spin != 0.0F));
}

void Sleep::update_sleep_timer(BodyStore& b, std::size_t i) const {
  const float max_speed = b.is_jointed[i] ? kMaxJointedSleepSpeed : kMaxSleepSpeed;
  const bool is_still = max_point_speed(b, i) < rest_scale_ * max_speed && b.wrench[i].is_zero();
  float& timer_s = b.sleep_timer_s[i];
  if (!is_still) {
    timer_s = 0.0F;
    return;
  }
  RestMotion& motion = b.rest_motion[i];
  if (timer_s == 0.0F) motion = {};
  // A body that is ready to sleep, but whose neighbours are not, goes through one period after the other.
  const float in_period_s = timer_s < kTimeToSleep_s ? timer_s : timer_s - kTimeToSleep_s;
  const float sign = in_period_s < 0.5F * kTimeToSleep_s ? -1.0F : 1.0F;
  motion.velocity += sign * b.velocity(i);
  motion.angular_velocity += sign * b.angular_velocity(i);
  timer_s += dt_s_;
  if (in_period_s + dt_s_ < kTimeToSleep_s) return;
  timer_s = accelerates(b, i, dt_s_, rest_scale_) ? dt_s_ : kTimeToSleep_s;
  motion = {};
}

void Sleep::reset_timers_on_moving_cells(BodyStore& b, const ContactList& static_contacts,
                                         IndexRange manifolds) const {
  for (int i = manifolds.begin; i < manifolds.end; ++i) {
    const Manifold& m = static_contacts.manifolds[i];
    for (const Contact& c : static_contacts.contacts_of(m))
      if (touches_moving_cell(c)) b.sleep_timer_s[m.a] = 0.0F;
  }
}

void Sleep::reset_timers_on_patches(BodyStore& b, const SupportPatches& supports) const {
  for (const SupportPatch& p : supports.patches)
    if (p.moves || (p.is_elastic && swings(b, p, dt_s_, rest_scale_))) b.sleep_timer_s[p.body] = 0.0F;
}

void Sleep::update_sleeping_set(BodyStore& b, const std::vector<std::int32_t>& active_bodies,
                                const ContactList& pair_contacts, const ContactList& static_contacts,
                                std::span<const SupportPatches> supports,
                                const std::function<void()>& find_loads,
                                std::span<const IslandBody> direct_islands) {
  wake_where_placed(b, pair_contacts);
  const bool any_ready = std::any_of(active_bodies.begin(), active_bodies.end(),
                                     [&b](std::int32_t i) { return b.sleep_timer_s[i] >= kTimeToSleep_s; });
  if (!is_enabled_ || (!any_ready && !any_asleep())) return;
  // Entries of sleepers and static bodies are not read.
  has_active_neighbour_.resize(b.asleep.size());
  is_supported_.resize(b.asleep.size());
  std::vector<char>& is_supported = is_supported_;
  for (const std::int32_t i : active_bodies) {
    has_active_neighbour_[i] = 0;
    is_supported[i] = static_cast<char>(gravity_.isZero(0.0F));
  }
  // Bodies that touch fall asleep together: a sleeper is immovable, and would go on bearing the load of that
  // moment while the rest settles. One that moves wakes what it touches.
  auto keep_together = [&](std::size_t i, std::size_t j) {
    for (const auto& [one, other] : {std::pair{i, j}, std::pair{j, i}}) {
      if (!b.is_active(one) || b.sleep_timer_s[one] >= kTimeToSleep_s) continue;
      has_active_neighbour_[other] = 1;
      if (b.sleep_timer_s[one] == 0.0F && b.asleep[other]) wake(b, other);
    }
  };
  for (const Manifold& m : pair_contacts.manifolds) {
    const Index i = m.a, j = m.b;
    is_supported[i] = is_supported[j] = 1;
    keep_together(i, j);
  }
  for (const Manifold& m : static_contacts.manifolds) is_supported[m.a] = 1;
  for (const BodyLink& link : b.links) {
    is_supported[link.a] = 1;
    if (link.b >= 0) is_supported[link.b] = 1;
  }
  keep_pushed_awake(b, active_bodies, pair_contacts);
  keep_awake_with_others(b, pair_contacts, direct_islands);
  fallen_.clear();
  for (const std::int32_t i : active_bodies) {
    if (b.sleep_timer_s[i] >= kTimeToSleep_s && !has_active_neighbour_[i] && is_supported[i])
      put_to_sleep(b, i), fallen_.push_back(i);
  }
  if (fallen_.empty()) return;
  find_loads();
  auto asleep = [&b](std::int32_t i) { return b.asleep[i] != 0; };
  for (const Manifold& m : pair_contacts.manifolds)
    if (asleep(m.a) && asleep(m.b)) contacts_.add(pair_contacts, m, b.size());
  for (const Manifold& m : static_contacts.manifolds)
    if (asleep(m.a)) contacts_.add(static_contacts, m, b.size());
  for (const SupportPatches& list : supports)
    for (const SupportPatch& p : list.patches)
      if (asleep(p.body)) contacts_.add(list, p, b.size());
  rest_loads_.balance(b, fallen_, pair_contacts, contacts_);
}

// A placed body may rest on sleepers at once: they, and those that bear them, would not feel it.
void Sleep::wake_where_placed(BodyStore& b, const ContactList& pair_contacts) {
  if (placed_.empty()) return;
  const auto is_placed = [this](std::int32_t i) { return std::ranges::find(placed_, i) != placed_.end(); };
  for (const Manifold& m : pair_contacts.manifolds) {
    if (!b.asleep[m.a] && !b.asleep[m.b]) continue;
    const auto [sleeper, other] = b.asleep[m.a] ? std::pair{m.a, m.b} : std::pair{m.b, m.a};
    if (is_placed(other)) wake_island(b, sleeper);
  }
  placed_.clear();
}

// A joint, a force or a conveyor may push a row of bodies so slowly that each of them could fall asleep; one
// that did would stop the row.
void Sleep::keep_pushed_awake(BodyStore& b, const std::vector<std::int32_t>& active_bodies,
                              const ContactList& pair_contacts) {
  const auto is_driven = [&](std::int32_t i) {
    return b.sleep_timer_s[i] == 0.0F &&
           (b.is_jointed[i] || !b.wrench[i].is_zero() || field_.has_surface_velocity());
  };
  if (std::ranges::none_of(active_bodies, is_driven)) return;
  is_pushed_.assign(b.asleep.size(), 0);
  for (const std::int32_t i : active_bodies) is_pushed_[i] = static_cast<char>(is_driven(i));
  for (bool changed = true; changed;) {
    changed = false;
    for (const Manifold& m : pair_contacts.manifolds) {
      if (is_pushed_[m.a] == is_pushed_[m.b]) continue;
      const std::int32_t other = is_pushed_[m.a] ? m.b : m.a;
      if (b.is_static(other)) continue;
      if (b.asleep[other]) wake(b, other);
      is_pushed_[other] = has_active_neighbour_[other] = 1;
      changed = true;
    }
  }
}

// Bodies that lie on one that cannot sleep yet, at whatever height, stay awake as well: a sleeper bears
// itself, and would take its weight off those below. So do bodies that joints connect with it, and those of
// its island that the direct solver has.
void Sleep::keep_awake_with_others(const BodyStore& b, const ContactList& pair_contacts,
                                   std::span<const IslandBody> direct_islands) {
  const auto stays_awake = [&](std::size_t i) {
    return b.is_active(i) && (has_active_neighbour_[i] || b.sleep_timer_s[i] < kTimeToSleep_s);
  };
  for (bool changed = true; changed;) {
    changed = false;
    for (const Manifold& m : pair_contacts.manifolds) {
      if (stays_awake(m.a) == stays_awake(m.b)) continue;
      const auto [above, below] = stacked(m, pair_contacts.contacts[m.first]);
      if (above < 0 || !b.is_active(above) || !stays_awake(below)) continue;
      has_active_neighbour_[above] = 1;
      changed = true;
    }
    for (const BodyLink& link : b.links) {
      if (link.b < 0 || stays_awake(link.a) == stays_awake(link.b)) continue;
      const std::int32_t other = stays_awake(link.a) ? link.b : link.a;
      if (!b.is_active(other)) continue;
      has_active_neighbour_[other] = 1;
      changed = true;
    }
    for (auto begin = direct_islands.begin(), end = begin; begin != direct_islands.end(); begin = end) {
      end = std::find_if(begin, direct_islands.end(),
                         [&](const IslandBody& i) { return i.island != begin->island; });
      if (std::none_of(begin, end, [&](const IslandBody& i) { return stays_awake(i.body); })) continue;
      for (const IslandBody& i : std::span(begin, end)) {
        changed |= !stays_awake(i.body);
        has_active_neighbour_[i.body] = 1;
      }
    }
  }
}

void Sleep::put_to_sleep(BodyStore& b, std::size_t i) {
  b.asleep[i] = 1;
  BodyVelocity& m = b.body_velocity[i];
  m = {};
  b.world_inverse_inertia[i] = {};
  b.delta_pose[i] = {};
  cells_near_sleeper_.resize(b.asleep.size());
  cells_near_sleeper_[i] = cells_near(b, i);
  ++sleeping_count_;
  ++set_version_, ++contacts_version_;
}

// The cells under the body and a margin of one cell, whose motion may reach the body too.
Sleep::CellRect Sleep::cells_near(const BodyStore& b, std::size_t i) const {
  Vec3 half = turned_extents(b.axes[i], b.shape[i]->half_extents);
  if (field_.has_tips()) half += Vec3::Constant(field_.tip_reach);
  const Vec3 at = b.origin(i);
  auto clamped = [](float u, int max) {
    return std::clamp(static_cast<int>(std::clamp(u, -1e6F, 1e6F)), 0, max);
  };
  const float p = field_.pitch, south = static_cast<float>(field_.rows - 1);
  return {clamped(std::floor(south - (at.y() + half.y()) / p) - 1.0F, field_.rows),
          clamped(std::ceil(south - (at.y() - half.y()) / p) + 2.0F, field_.rows),
          clamped(std::floor((at.x() - half.x()) / p) - 1.0F, field_.columns),
          clamped(std::ceil((at.x() + half.x()) / p) + 2.0F, field_.columns)};
}

void Sleep::on_body_removed(std::int32_t body) {
  contacts_.on_body_removed(body);
  for (std::vector<std::int32_t>* list : {&woken_, &placed_}) {
    std::erase(*list, body);
    for (std::int32_t& i : *list)
      if (i > body) --i;
  }
  if (body < std::ssize(cells_near_sleeper_)) cells_near_sleeper_.erase(cells_near_sleeper_.begin() + body);
  ++set_version_, ++contacts_version_;
}

}  // namespace smartsurf::world
