#include "smartsurf/world/RestLoads.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "smartsurf/world/contact/ContactMaterial.h"

namespace smartsurf::world {
namespace {

using Map6 = Eigen::Map<Eigen::Matrix<double, 6, 1>>;
using ConstMap6 = Eigen::Map<const Eigen::Matrix<double, 6, 1>>;
using Vec3d = Eigen::Vector3d;

// More bodies than these, of which an awake one touches some, wait until it sleeps too: a heap falls asleep
// body by body.
constexpr std::size_t kMaxIncomplete = 32;
constexpr double kBalanced = 2e-4;  // what forces may lack, relative to a body's weight
constexpr double kAtRest =
    1e-3;  // the same where nothing bears it: a sleeper may have accelerated by as much
constexpr double kTolerance = 1e-6;  // of the solution, relative to the weight of the island
constexpr int kMaxRounds = 12;
// Weights of components, relative to that of their normal: an object that jitters lifts rather than slips.
constexpr double kTangentWeight = 0.1, kRollingWeight = 0.01, kTouchingWeight = 0.1;

Vec3d to_double(const Vec3& v) { return v.cast<double>(); }

// True for the rows that hold a constant moment; see RestLoads::add_rows().
constexpr auto is_rest_of_moment = [](const auto& row) { return row.load == nullptr && !row.touches; };

}  // namespace

void RestLoads::balance(const BodyStore& bodies, std::span<const std::int32_t> fallen,
                        const ContactList& pair_contacts, SleepingContacts& contacts) {
  if (settings_.gravity.isZero(0.0F)) return;
  find_touches(bodies, pair_contacts);
  index_of_body_.assign(bodies.asleep.size(), -1);
  for (const std::int32_t body : fallen) {
    if (index_of_body_[body] >= 0) continue;
    if (!collect_island(bodies, body, contacts) || is_incomplete()) continue;
    add_rows(bodies, contacts);
    add_weight_and_neighbours(bodies, pair_contacts);
    if (is_balanced(kBalanced) || !solve()) continue;
    for (const Row& r : rows_)
      if (r.load != nullptr) *r.load = static_cast<float>(r.impulse);
  }
}

void RestLoads::find_touches(const BodyStore& bodies, const ContactList& pair_contacts) {
  touches_.clear();
  for (std::size_t k = 0; k < pair_contacts.manifolds.size(); ++k) {
    const Manifold& m = pair_contacts.manifolds[k];
    if (bodies.is_active(m.a) != bodies.is_active(m.b))
      touches_.push_back({bodies.is_active(m.a) ? m.b : m.a, static_cast<std::int32_t>(k)});
  }
  std::ranges::sort(touches_);
}

std::span<const RestLoads::Touch> RestLoads::touches_of(std::int32_t body) const {
  const auto begin = std::ranges::lower_bound(touches_, body, {}, &Touch::sleeper);
  return {begin, std::ranges::upper_bound(begin, touches_.end(), body, {}, &Touch::sleeper)};
}

// True if bodies on a large island are awake: once they sleep or leave, its loads change again.
bool RestLoads::is_incomplete() const {
  return island_.size() > kMaxIncomplete &&
         std::ranges::any_of(island_, [this](std::int32_t body) { return !touches_of(body).empty(); });
}

// Collects the sleepers connected to `from`. Returns false if their loads are not balanced here.
bool RestLoads::collect_island(const BodyStore& bodies, std::int32_t from, const SleepingContacts& contacts) {
  island_.assign(1, from);
  index_of_body_[from] = 0;
  bool has_joints = false;
  for (std::size_t k = 0; k < island_.size(); ++k) {
    has_joints |= bodies.is_jointed[island_[k]] != 0;
    contacts.for_each_neighbour(island_[k], [&](std::int32_t other) {
      if (index_of_body_[other] >= 0 || !bodies.asleep[other]) return;
      index_of_body_[other] = static_cast<std::int32_t>(island_.size());
      island_.push_back(other);
    });
  }
  return !has_joints && island_.size() <= LargeBlockCholesky::kMaxRows;
}

void RestLoads::add_rows(const BodyStore& bodies, SleepingContacts& contacts) {
  rows_.clear();
  radius_.clear(), inverse_radius_.clear();
  for (const std::int32_t body : island_) {
    radius_.push_back(bodies.bounding_radius[body]);
    inverse_radius_.push_back(1.0 / radius_.back());
  }
  for (const std::int32_t body : island_) {
    Vec3 normal = Vec3::Zero();
    Vec3d moment = Vec3d::Zero();
    float limit = std::numeric_limits<float>::infinity();
    contacts.for_each_contact_of(body, [&](const Manifold& m, Contact& c) {
      if (m.a != body) return;  // that body's turn
      add_contact(bodies, m, c);
      if (!c.is_in_patch()) return;
      normal += c.normal;
      moment += to_double(c.anchor).cross(to_double(c.normal)) * static_cast<double>(c.total_normal_impulse);
      limit = std::min(limit, c.max_cell_impulse);
    });
    contacts.with_patch_of(body, [&](SupportPatch& p, SupportSamples& s) {
      const std::size_t first = rows_.size();
      add_patch(p, s, normal.isZero(0.0F) ? Vec3(0, 0, 1) : Vec3(normal.normalized()), limit);
      if (p.is_elastic) return;
      // A sample bears at the middle of an area, of which a body that overhangs may touch the rim alone: what
      // the moment of the loads then lacks of that at the points stays.
      const std::int32_t place = index_of_body_[body];
      const std::size_t end = rows_.size();
      Row& rest = add_row(place, -1);
      rest.start = rest.impulse = 1.0;
      rest.touches = rest.is_free = false;
      for (int k = 0; k < 3; ++k) {
        rest.on_a[3 + k] = moment[k] * inverse_radius_[place];
        for (std::size_t row = first; row < end; ++row)
          rest.on_a[3 + k] -= rows_[row].start * rows_[row].on_a[3 + k];
      }
    });
  }
}

RestLoads::Row& RestLoads::add_row(std::int32_t a, std::int32_t b) {
  return rows_.emplace_back(Row{.a = a, .b = b});
}

void RestLoads::add_contact(const BodyStore& bodies, const Manifold& m, Contact& c) {
  const std::int32_t a = index_of_body_[m.a], b = m.b >= 0 ? index_of_body_[m.b] : -1;
  const Vec3 anchor_a = bodies.is_sphere[m.a] ? Vec3(-bodies.bounding_radius[m.a] * c.normal) : c.anchor;
  Vec3 anchor_b = Vec3::Zero();
  if (b >= 0)
    anchor_b = bodies.is_sphere[m.b] ? Vec3(bodies.bounding_radius[m.b] * c.normal)
                                     : Vec3(bodies.position[m.a] + c.anchor - bodies.position[m.b]);
  const auto add_force = [&](const Vec3& along) -> Row& {
    Row& r = add_row(a, b);
    const Vec3d d = to_double(along);
    const auto fill = [&](Vector6& on, const Vec3& anchor, double sign, std::int32_t place) {
      const Vec3d moment = to_double(anchor).cross(d) * inverse_radius_[place];
      for (int k = 0; k < 3; ++k) on[k] = sign * d[k], on[3 + k] = sign * moment[k];
    };
    fill(r.on_a, anchor_a, 1.0, a);
    if (b >= 0) fill(r.on_b, anchor_b, -1.0, b);
    return r;
  };
  // The load in a patch is that of a sample. The point still has a share of the friction.
  const bool has_load = !c.is_in_patch();
  const auto substeps = static_cast<float>(settings_.substeps);
  const auto normal = static_cast<std::int32_t>(rows_.size());
  if (has_load) {
    Row& r = add_force(c.normal);
    r.start = r.weight = std::max(0.0F, c.total_normal_impulse);
    r.load = &c.total_normal_impulse;
    r.limit = c.max_cell_impulse;
    r.touches = c.separation < kTouchingSeparation;
  }
  const float friction =
      friction_of(bodies.surface_material[m.a], material_of_b(bodies, settings_.field_material, m, c));
  const Vec3 t = c.normal.unitOrthogonal(), u = c.normal.cross(t);
  for (const Vec3& axis : {t, u}) {
    if (friction == 0.0F) break;
    Row& r = add_force(axis);
    r.start = substeps * axis.dot(c.friction_impulse);
    r.weight = kTangentWeight * std::min(1.0, static_cast<double>(friction)) *
               std::max(0.0F, c.total_normal_impulse);
    r.normal = has_load ? normal : -1;
  }
  if (!has_load || c.rolling_impulse.isZero(0.0F)) return;
  for (int axis = 0; axis < 3; ++axis) {
    Row& r = add_row(a, b);
    r.on_a[3 + axis] = inverse_radius_[a];
    if (b >= 0) r.on_b[3 + axis] = -inverse_radius_[b];
    r.start = substeps * c.rolling_impulse[axis];
    r.weight = kRollingWeight * radius_[a] * radius_[a] * std::max(0.0F, c.total_normal_impulse);
    r.normal = normal;
  }
}

void RestLoads::add_patch(SupportPatch& p, SupportSamples& s, const Vec3& normal, float limit) {
  const std::int32_t a = index_of_body_[p.body];
  const Vec3d d = to_double(normal);
  for (Index i = p.first; i < p.first + p.count; ++i) {
    Row& r = add_row(a, -1);
    const Vec3d moment = Vec3d(s.x[i], s.y[i], p.z).cross(d) * inverse_radius_[a];
    for (int k = 0; k < 3; ++k) r.on_a[k] = d[k], r.on_a[3 + k] = moment[k];
    r.start = r.weight = std::max(0.0F, s.load[i]);
    r.load = &s.load[i];
    r.limit = limit;
    r.touches = s.weight[i] > 0.0F;
  }
}

// Sets the load on each body, and the residual that the impulses leave of it.
void RestLoads::add_weight_and_neighbours(const BodyStore& bodies, const ContactList& pair_contacts) {
  load_.assign(island_.size(), Vector6{});
  own_weight_.clear();
  for (std::size_t i = 0; i < island_.size(); ++i) {
    const Vec3d weight =
        to_double(settings_.gravity) * (static_cast<double>(bodies.mass[island_[i]]) * settings_.dt_s);
    own_weight_.push_back(weight.norm());
    for (int k = 0; k < 3; ++k) load_[i][k] = -weight[k];
  }
  const auto substeps = static_cast<float>(settings_.substeps);
  for (std::size_t i = 0; i < island_.size(); ++i)
    for (const Touch& touch : touches_of(island_[i])) {
      const Manifold& m = pair_contacts.manifolds[touch.manifold];
      const bool is_a = touch.sleeper == m.a;
      for (const Contact& c : pair_contacts.contacts_of(m)) {
        const Vec3 impulse = c.total_normal_impulse * c.normal + substeps * c.friction_impulse;
        const Vec3 anchor = is_a ? c.anchor : Vec3(bodies.position[m.a] + c.anchor - bodies.position[m.b]);
        const Vec3d moment = to_double(anchor).cross(to_double(impulse)) * inverse_radius_[i];
        const double sign = is_a ? 1.0 : -1.0;
        for (int k = 0; k < 3; ++k)
          load_[i][k] -= sign * static_cast<double>(impulse[k]), load_[i][3 + k] -= sign * moment[k];
      }
    }
  double sum = 0.0;
  int count = 0;
  for (const Row& r : rows_)
    if (r.load != nullptr && r.start > 0.0) sum += r.start, ++count;
  mean_load_ = count > 0 ? sum / count : 0.0;
  residual_ = load_;
  for (const Row& r : rows_) subtract(r, r.start);
}

bool RestLoads::is_balanced(double tolerance) const {
  double greatest = 0.0;
  for (std::size_t i = 0; i < island_.size(); ++i)
    greatest = std::max(greatest, ConstMap6(residual_[i].data()).norm() / own_weight_[i]);
  return greatest < tolerance;
}

void RestLoads::set_free(bool with_touching) {
  for (Row& r : rows_) {
    if (r.load != nullptr && r.start <= 0.0)
      r.weight = with_touching && r.touches ? kTouchingWeight * mean_load_ : 0.0;
    r.is_free = r.weight > 0.0;
  }
}

// Frees the loads that bear, and then also those that touch; takes out those that would pull. Samples bear
// the moment if they can.
bool RestLoads::solve() {
  const auto is_plausible = [](const Row& r) {
    // A cell that would be overloaded gives way: the bodies are not at rest.
    constexpr double kRounding = 1.0001;
    if (r.load != nullptr) return r.impulse <= kRounding * static_cast<double>(r.limit);
    // Friction that changes by as much as its cone is wide did not come from jitter.
    const bool is_tangent = r.on_a[0] != 0.0 || r.on_a[1] != 0.0 || r.on_a[2] != 0.0;
    return !is_tangent || !r.is_free || std::abs(r.impulse - r.start) * kTangentWeight <= r.weight;
  };
  matrix_.reset(static_cast<int>(island_.size()));
  for (const Row& r : rows_)
    if (r.b >= 0) matrix_.connect(r.a, r.b);
  matrix_.analyse();
  for (const double rest_of_moment : {0.0, 1.0})
    for (const bool with_touching : {false, true}) {
      for (Row& r : rows_)
        if (is_rest_of_moment(r)) r.start = rest_of_moment;
      set_free(with_touching);
      for (int round = 0; round < kMaxRounds && find_impulses(); ++round) {
        bool pulls = false;
        for (Row& r : rows_)
          if (r.load != nullptr && r.is_free && r.impulse < 0.0) r.is_free = false, pulls = true;
        if (pulls) continue;
        if (std::ranges::all_of(rows_, is_plausible)) return true;
        break;
      }
    }
  return false;
}

// impulse = start + weight · Jᵀ·x, with which the impulses balance the load: (J · weight · Jᵀ)·x = what they
// lack. Returns whether they do, except for what no contact can bear, as a ball's weight along a face that is
// hardly tilted.
bool RestLoads::find_impulses() {
  const auto is_free = [&](const Row& r) { return r.is_free && (r.normal < 0 || rows_[r.normal].is_free); };
  residual_ = load_;
  for (Row& r : rows_) {
    const bool is_constant = r.load == nullptr && r.normal < 0 && r.weight == 0.0;
    r.is_used = is_free(r);
    r.impulse = r.is_used || is_constant ? r.start : 0.0;
    subtract(r, r.impulse);
  }
  add_free_rows();
  if (!matrix_.factor()) return false;
  double scale = 0.0;
  for (const double weight : own_weight_) scale += weight;
  // Iterative refinement: the matrix has a little more on the diagonal than the equations.
  double lacks = std::numeric_limits<double>::infinity();
  while (true) {
    work_ += island_.size();
    double square = 0.0;
    for (const Vector6& r : residual_) square += ConstMap6(r.data()).squaredNorm();
    const double last = std::exchange(lacks, std::sqrt(square));
    if (lacks <= kTolerance * scale) return true;
    if (!(lacks < 0.5 * last)) return is_balanced(kAtRest);
    change_ = residual_;
    matrix_.solve(change_.front().data());
    for (Row& r : rows_) {
      if (!r.is_used) continue;
      double speed = ConstMap6(r.on_a.data()).dot(ConstMap6(change_[r.a].data()));
      if (r.b >= 0) speed += ConstMap6(r.on_b.data()).dot(ConstMap6(change_[r.b].data()));
      r.impulse += r.weight * speed;
      subtract(r, r.weight * speed);
    }
  }
}

// Removes an impulse along the row from the residuals.
void RestLoads::subtract(const Row& r, double impulse) {
  Map6(residual_[r.a].data()) -= impulse * ConstMap6(r.on_a.data());
  if (r.b >= 0) Map6(residual_[r.b].data()) -= impulse * ConstMap6(r.on_b.data());
}

// J · weight · Jᵀ, with a little more on the diagonal: a body may be free to turn about the edge on which it
// lies.
void RestLoads::add_free_rows() {
  constexpr std::size_t kTogether = 3;
  matrix_.clear();
  trace_.assign(island_.size(), 0.0);
  for (std::size_t first = 0, end = 0; first < rows_.size(); first = end) {
    const std::int32_t a = rows_[first].a, b = rows_[first].b;
    LargeBlockCholesky::Rows on_a = {}, on_b = {};
    double weight[kTogether] = {};
    for (std::size_t k = 0; k < kTogether && end < rows_.size(); ++k) {
      const Row& r = rows_[end];
      if (r.a != a || r.b != b) break;
      ++end;
      if (!r.is_used) continue;
      weight[k] = r.weight;
      std::ranges::copy(r.on_a, on_a[k]);
      std::ranges::copy(r.on_b, on_b[k]);
      trace_[a] += r.weight * ConstMap6(r.on_a.data()).squaredNorm();
      if (b >= 0) trace_[b] += r.weight * ConstMap6(r.on_b.data()).squaredNorm();
    }
    matrix_.add(a, a, weight, on_a, on_a);
    if (b < 0) continue;
    matrix_.add(b, b, weight, on_b, on_b);
    matrix_.add(a, b, weight, on_a, on_b);
  }
  constexpr double kDiagonalRegularisation = 1e-9;
  for (std::size_t i = 0; i < trace_.size(); ++i)
    for (int k = 0; k < LargeBlockCholesky::kSize; ++k)
      matrix_.add_to_diagonal(static_cast<int>(i), k, k,
                              kDiagonalRegularisation * std::max(trace_[i], 1e-30));
}

}  // namespace smartsurf::world
