#include "smartsurf/world/CellLimits.h"

#include <algorithm>
#include <cmath>

namespace smartsurf::world {
namespace {

// A contact that leans more than this is with a cell's side and does not push it down.
constexpr float kSide = 0.05F;
// What rests on a cell overlaps it by about so much, u.
constexpr float kRestingOverlap = 2e-3F;
// The share of its force from which on a cell counts as giving all of it.
constexpr float kAll = 0.99F;
// So much of a cell's force is shared out evenly, the rest as it was used in the last step: so a contact that
// needs more gets more from step to step, as far as others can spare it.
constexpr float kEvenPart = 0.2F;

}  // namespace

template <class List, class Each>
void CellLimits::for_limited(const surface::Field& field, List& world, Each each) const {
  for (const Manifold& m : world.manifolds)
    for (int k = m.first; k < m.first + m.count; ++k) {
      auto& c = world.contacts[static_cast<std::size_t>(k)];
      if (c.other != kField || c.normal.z() < kSide) continue;
      const auto cell = static_cast<std::size_t>(c.key);
      if (std::isfinite(field.force_limit[cell])) each(c, m, cell);
    }
}

void CellLimits::share_out(const surface::Field& field, float dt_s, ContactList& world) {
  if (!field.yields()) return;
  load_.resize(field.height.size(), 0.0F);
  sharers_.resize(field.height.size(), 0);
  for_limited(field, world, [&](const Contact& c, const Manifold&, std::size_t cell) {
    load_[cell] += c.push * c.normal.z();
    ++sharers_[cell];
  });
  for_limited(field, world, [&](Contact& c, const Manifold&, std::size_t cell) {
    const float even = 1.0F / static_cast<float>(sharers_[cell]);
    const float used = load_[cell] > 0.0F ? c.push * c.normal.z() / load_[cell] : even;
    const float share = kEvenPart * even + (1.0F - kEvenPart) * used;
    c.limit = field.force_limit[cell] * dt_s * share / c.normal.z();
  });
  for_limited(field, world, [&](const Contact&, const Manifold&, std::size_t cell) {
    load_[cell] = 0.0F;
    sharers_[cell] = 0;
  });
}

void CellLimits::give_way(const BodyStore& bodies, const ContactList& world, float dt_s,
                          surface::Field& field) {
  if (!field.yields()) return;
  for_limited(field, world, [&](const Contact& c, const Manifold&, std::size_t cell) {
    load_[cell] += c.total * c.normal.z();
  });
  for_limited(field, world, [&](const Contact& c, const Manifold& m, std::size_t cell) {
    if (c.total <= 0.0F || load_[cell] < kAll * field.force_limit[cell] * dt_s) return;
    const Shift& shift = bodies.shift[static_cast<std::size_t>(m.a)];
    const Vec3 moved = Vec3(shift.by) + Vec3(shift.turn).cross(c.arm);
    // How far the top can go along its axis: as far as the body's point did, but what overlapped must part.
    const float apart = c.gap < 0.0F ? std::min(0.0F, c.gap + kRestingOverlap) : c.gap;
    const float over = (apart + c.normal.dot(moved)) / c.normal.z();
    field.speed[cell] = std::min(field.speed[cell], over / dt_s);
  });
  for_limited(field, world, [&](const Contact&, const Manifold&, std::size_t cell) { load_[cell] = 0.0F; });
}

}  // namespace smartsurf::world
