#include "smartsurf/world/Sleep.h"

#include <algorithm>
#include <cmath>

namespace smartsurf::world {
namespace {

constexpr float kRestSpeed = 0.06F;  // hardly moving: slower than this, at the surface too, u/s
constexpr float kRestTime_s = 0.5F;  // for so long
constexpr float kFastSpeed = 0.6F;   // what moves faster wakes all that is connected with what it meets

float fastest_point(const BodyStore& b, std::size_t i) {
  return b.velocity(i).norm() + b.spin(i).norm() * b.reach[i];
}

// Moves manifolds for which `chosen` holds from one list to another.
template <class Chosen>
void move_manifolds(ContactList& from, ContactList& to, Chosen chosen) {
  ContactList kept;
  for (const Manifold& m : from.manifolds) {
    ContactList& list = chosen(m) ? to : kept;
    list.manifolds.push_back({m.a, m.b, static_cast<std::int32_t>(list.contacts.size()), m.count});
    const auto first = from.contacts.begin() + m.first;
    list.contacts.insert(list.contacts.end(), first, first + m.count);
  }
  from = std::move(kept);
}

template <class Chosen>
void copy_manifolds(const ContactList& from, ContactList& to, Chosen chosen) {
  for (const Manifold& m : from.manifolds) {
    if (!chosen(m)) continue;
    to.manifolds.push_back({m.a, m.b, static_cast<std::int32_t>(to.contacts.size()), m.count});
    const auto first = from.contacts.begin() + m.first;
    to.contacts.insert(to.contacts.end(), first, first + m.count);
  }
}

}  // namespace

bool Sleep::fast(const BodyStore& b, std::size_t i) { return fastest_point(b, i) > kFastSpeed; }

// ---- waking

void Sleep::wake(BodyStore& b, std::size_t i) {
  b.still_s[i] = 0.0F;
  if (!b.asleep[i]) return;
  b.asleep[i] = 0;
  b.motion[i].inverse_mass = 1.0F / b.mass[i];
  b.motion[i].inverse_inertia = b.own_inertia[i].inverse[0];
  b.turn_axes(i);
  --sleepers_;
  ++changes_;
  woken_ = true;
}

void Sleep::wake_connected(BodyStore& b, std::size_t body) {
  if (!b.asleep[body]) return wake(b, body);
  wake(b, body);
  // Round after round, until no contact joins the woken and the sleeping.
  for (bool more = true; more;) {
    more = false;
    for (const Manifold& m : pairs_.manifolds) {
      const auto i = static_cast<std::size_t>(m.a), j = static_cast<std::size_t>(m.b);
      if (b.asleep[i] == b.asleep[j]) continue;
      wake(b, b.asleep[i] ? i : j);
      more = true;
    }
  }
}

void Sleep::disturb(BodyStore& b, std::size_t body, const ContactList& pairs, const ContactList& world) {
  const auto index = static_cast<std::int32_t>(body);
  // What is fixed finds no contacts of its own: whatever it may meet must look for them.
  if (b.fixed(body))
    for (std::size_t i = 0; i < b.asleep.size(); ++i) wake(b, i);
  wake(b, body);
  for (const ContactList* list : {&pairs, &static_cast<const ContactList&>(pairs_)})
    for (const Manifold& m : list->manifolds)
      if (m.a == index || m.b == index) wake(b, static_cast<std::size_t>(m.a == index ? m.b : m.a));
  for (const ContactList* list : {&world, &static_cast<const ContactList&>(world_)})
    for (const Manifold& m : list->manifolds)
      for (int k = m.first; k < m.first + m.count; ++k)
        if (list->contacts[static_cast<std::size_t>(k)].other == index)
          wake(b, static_cast<std::size_t>(m.a));
}

void Sleep::wake_what_is_pushed(BodyStore& b) {
  for (std::size_t i = 0; i < b.wrench.size(); ++i)
    if (!b.wrench[i].zero() && !b.fixed(i)) wake(b, i);
}

void Sleep::wake_on_moving_cells(BodyStore& b) {
  if (!any() || (field_.max_speed == 0.0F && !field_.drags())) return;
  const auto columns = static_cast<std::size_t>(field_.columns);
  row_moves_.resize(static_cast<std::size_t>(field_.rows));
  for (std::size_t r = 0; r < row_moves_.size(); ++r) {
    int moving = 0;
    auto look = [&](const std::vector<float>& values) {
      if (values.empty()) return;
      const float* row = &values[r * columns];
      for (std::size_t c = 0; c < columns; ++c) moving |= static_cast<int>(row[c] != 0.0F);
    };
    look(field_.speed);
    look(field_.drag_x);
    look(field_.drag_y);
    look(field_.spin);
    row_moves_[r] = moving != 0;
  }
  // Where rows and columns tell nothing of places, any motion may be near.
  const bool anywhere = !field_.rectangular() && std::count(row_moves_.begin(), row_moves_.end(), 1) > 0;
  for (std::size_t i = 0; i < b.asleep.size(); ++i)
    if (b.asleep[i] && (anywhere || cells_move(cells_[i]))) wake(b, i);
}

bool Sleep::cells_move(const Cells& cells) const {
  for (int r = cells.row_begin; r < cells.row_end; ++r) {
    if (!row_moves_[static_cast<std::size_t>(r)]) continue;
    for (int c = cells.column_begin; c < cells.column_end; ++c) {
      const auto i = static_cast<std::size_t>(field_.index(r, c));
      if (field_.speed[i] != 0.0F) return true;
      if (field_.drags() && (field_.drag_x[i] != 0.0F || field_.drag_y[i] != 0.0F)) return true;
      if (!field_.spin.empty() && field_.spin[i] != 0.0F) return true;
    }
  }
  return false;
}

void Sleep::return_contacts(const BodyStore& b, ContactList& pairs, ContactList& world) {
  if (!woken_) return;
  woken_ = false;
  ++changes_;
  auto awake = [&b](std::int32_t i) { return !b.asleep[static_cast<std::size_t>(i)]; };
  move_manifolds(pairs_, pairs, [&](const Manifold& m) { return awake(m.a) || awake(m.b); });
  move_manifolds(world_, world, [&](const Manifold& m) { return awake(m.a); });
}

// ---- falling asleep

bool Sleep::stands_on_moving_cells(const Contact& c) const {
  return c.other == kField && (!c.surface.isZero(0.0F) || c.surface_spin != 0.0F);
}

void Sleep::time_rest(BodyStore& b, std::size_t i) const {
  const bool still = fastest_point(b, i) < kRestSpeed && b.wrench[i].zero();
  b.still_s[i] = still ? b.still_s[i] + dt_s_ : 0.0F;
}

void Sleep::unsettle(BodyStore& b, const ContactList& world, Range manifolds) const {
  for (int i = manifolds.begin; i < manifolds.end; ++i) {
    const Manifold& m = world.manifolds[static_cast<std::size_t>(i)];
    for (int k = m.first; k < m.first + m.count; ++k)
      if (stands_on_moving_cells(world.contacts[static_cast<std::size_t>(k)]))
        b.still_s[static_cast<std::size_t>(m.a)] = 0.0F;
  }
}

void Sleep::update(BodyStore& b, const std::vector<std::int32_t>& moving, const ContactList& pairs,
                   const ContactList& world) {
  const bool rested = std::any_of(moving.begin(), moving.end(), [&b](std::int32_t i) {
    return b.still_s[static_cast<std::size_t>(i)] >= kRestTime_s;
  });
  if (!rested && !any()) return;
  restless_.assign(b.asleep.size(), 0);
  std::vector<char>& held = held_;
  held.assign(b.asleep.size(), gravity_.isZero(0.0F));
  // What has a moving neighbour stays awake, and is woken by one.
  for (const Manifold& m : pairs.manifolds) {
    const auto i = static_cast<std::size_t>(m.a), j = static_cast<std::size_t>(m.b);
    held[i] = held[j] = 1;
    for (const auto& [one, other] : {std::pair{i, j}, std::pair{j, i}}) {
      if (b.asleep[one] || b.still_s[one] > 0.0F) continue;
      restless_[other] = 1;
      if (b.asleep[other]) wake(b, other);
    }
  }
  for (const Manifold& m : world.manifolds) held[static_cast<std::size_t>(m.a)] = 1;
  const int before = sleepers_;
  for (const std::int32_t k : moving) {
    const auto i = static_cast<std::size_t>(k);
    if (b.still_s[i] >= kRestTime_s && !restless_[i] && held[i]) lay_down(b, i);
  }
  if (sleepers_ == before) return;
  auto asleep = [&b](std::int32_t i) { return b.asleep[static_cast<std::size_t>(i)] != 0; };
  copy_manifolds(pairs, pairs_, [&](const Manifold& m) { return asleep(m.a) && asleep(m.b); });
  copy_manifolds(world, world_, [&](const Manifold& m) { return asleep(m.a); });
}

void Sleep::lay_down(BodyStore& b, std::size_t i) {
  b.asleep[i] = 1;
  Motion& m = b.motion[i];
  m = {};
  b.inertia[i] = {};
  b.shift[i] = {};
  cells_.resize(b.asleep.size());
  cells_[i] = cells_around(b, i);
  ++sleepers_;
  ++changes_;
}

// One cell more on every side: a neighbour that moves will soon be under it.
Sleep::Cells Sleep::cells_around(const BodyStore& b, std::size_t i) const {
  const Vec3 half = b.axes[i].cwiseAbs() * b.shape[i]->half;
  const Vec3& at = b.position[i];
  auto clamped = [](float u, int most) {
    return std::clamp(static_cast<int>(std::clamp(u, -1e6F, 1e6F)), 0, most);
  };
  const float p = field_.pitch, south = static_cast<float>(field_.rows - 1);
  return {clamped(std::floor(south - (at.y() + half.y()) / p) - 1.0F, field_.rows),
          clamped(std::ceil(south - (at.y() - half.y()) / p) + 2.0F, field_.rows),
          clamped(std::floor((at.x() - half.x()) / p) - 1.0F, field_.columns),
          clamped(std::ceil((at.x() + half.x()) / p) + 2.0F, field_.columns)};
}

void Sleep::forget_body(std::int32_t body) {
  forget(pairs_, body);
  forget(world_, body);
  if (static_cast<std::size_t>(body) < cells_.size()) cells_.erase(cells_.begin() + body);
  ++changes_;
}

}  // namespace smartsurf::world
