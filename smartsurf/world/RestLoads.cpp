#include "smartsurf/world/RestLoads.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

namespace smartsurf::world {
namespace {

using Block = Eigen::Matrix<double, 6, 6>;
using Map6 = Eigen::Map<Eigen::Matrix<double, 6, 1>>;
using ConstMap6 = Eigen::Map<const Eigen::Matrix<double, 6, 1>>;
using Vec3d = Eigen::Vector3d;

constexpr std::size_t kMaxBodies = 128;
constexpr double kBalanced = 2e-4;   // what forces may lack, relative to a body's weight
constexpr double kTolerance = 1e-6;  // of the solution, relative to the weight of the island
constexpr int kMaxRounds = 12;
constexpr float kTouchingSeparation = 1e-3F;  // u
// Weights of components, relative to that of their normal: an object that trembles lifts rather than slips.
constexpr double kTangentWeight = 0.1, kRollingWeight = 0.01, kTouchingWeight = 0.1;

Vec3d to_double(const Vec3& v) { return v.cast<double>(); }

// True for the rows that hold a constant moment; see RestLoads::add_rows().
constexpr auto is_rest_of_moment = [](const auto& row) { return row.load == nullptr && !row.touches; };

}  // namespace

void RestLoads::balance(const BodyStore& bodies, std::span<const std::int32_t> fallen,
                        const ContactList& pair_contacts, SleepingContacts& contacts) {
  if (settings_.gravity.isZero(0.0F)) return;
  place_.assign(bodies.asleep.size(), -1);
  for (const std::int32_t body : fallen) {
    if (place_[body] >= 0) continue;
    if (!collect_island(bodies, body, contacts)) continue;
    add_rows(bodies, contacts);
    add_weight_and_neighbours(bodies, pair_contacts);
    if (is_balanced() || !solve()) continue;
    for (const Row& r : rows_)
      if (r.load != nullptr) *r.load = static_cast<float>(r.impulse);
  }
}

// The sleepers that touch each other. Returns whether their loads are found here.
bool RestLoads::collect_island(const BodyStore& bodies, std::int32_t from, const SleepingContacts& contacts) {
  island_.assign(1, from);
  place_[from] = 0;
  bool has_joints = false;
  for (std::size_t k = 0; k < island_.size(); ++k) {
    has_joints |= bodies.is_jointed[island_[k]] != 0;
    contacts.for_each_neighbour(island_[k], [&](std::int32_t other) {
      if (place_[other] >= 0 || !bodies.asleep[other]) return;
      place_[other] = static_cast<std::int32_t>(island_.size());
      island_.push_back(other);
    });
  }
  return !has_joints && island_.size() <= kMaxBodies;
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
      if (c.partner != Partner::kSupportedCell && c.partner != Partner::kElasticTop) return;
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
      const std::int32_t place = place_[body];
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
  const std::int32_t a = place_[m.a], b = m.b >= 0 ? place_[m.b] : -1, other = other_body(m, c);
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
  // The load of a supported cell is that of a sample. Its point still has a share of the friction.
  const bool has_load = c.partner != Partner::kSupportedCell && c.partner != Partner::kElasticTop;
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
      bodies.surface_material[m.a].friction_root *
      (other >= 0 ? bodies.surface_material[other].friction_root : settings_.field_friction_root);
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
  const std::int32_t a = place_[p.body];
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

// What the impulses are to balance, and what they lack.
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
  for (const Manifold& m : pair_contacts.manifolds) {
    if (bodies.is_active(m.a) == bodies.is_active(m.b)) continue;
    const std::int32_t body = bodies.is_active(m.a) ? m.b : m.a;
    const std::int32_t i = place_[body];
    if (i < 0 || static_cast<std::size_t>(i) >= island_.size() || island_[i] != body) continue;
    const double sign = body == m.a ? 1.0 : -1.0;
    for (const Contact& c : pair_contacts.contacts_of(m)) {
      const Vec3 impulse = c.total_normal_impulse * c.normal + substeps * c.friction_impulse;
      const Vec3 anchor =
          body == m.a ? c.anchor : Vec3(bodies.position[m.a] + c.anchor - bodies.position[m.b]);
      const Vec3d moment = to_double(anchor).cross(to_double(impulse)) * inverse_radius_[i];
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
  for (const Row& r : rows_) {
    Map6(residual_[r.a].data()) -= r.start * ConstMap6(r.on_a.data());
    if (r.b >= 0) Map6(residual_[r.b].data()) -= r.start * ConstMap6(r.on_b.data());
  }
}

bool RestLoads::is_balanced() const {
  double greatest = 0.0;
  for (std::size_t i = 0; i < island_.size(); ++i)
    greatest = std::max(greatest, ConstMap6(residual_[i].data()).norm() / own_weight_[i]);
  return greatest < kBalanced;
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
    // Friction that changes by as much as its cone is wide did not come from a tremble.
    const bool is_tangent = r.on_a[0] != 0.0 || r.on_a[1] != 0.0 || r.on_a[2] != 0.0;
    return !is_tangent || !r.is_free || std::abs(r.impulse - r.start) * kTangentWeight <= r.weight;
  };
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
// lack, by conjugate gradients. Returns whether they do.
bool RestLoads::find_impulses() {
  const std::size_t n = island_.size();
  residual_ = load_;
  factor_.assign(n, {});
  const auto is_free = [&](const Row& r) { return r.is_free && (r.normal < 0 || rows_[r.normal].is_free); };
  for (Row& r : rows_) {
    const bool is_constant = r.load == nullptr && r.normal < 0 && r.weight == 0.0;
    r.impulse = is_free(r) || is_constant ? r.start : 0.0;
    const auto add = [&](std::int32_t i, const Vector6& on) {
      const ConstMap6 j(on.data());
      Map6(residual_[i].data()) -= r.impulse * j;
      if (is_free(r)) Eigen::Map<Block>(factor_[i].data()) += r.weight * j * j.transpose();
    };
    add(r.a, r.on_a);
    if (r.b >= 0) add(r.b, r.on_b);
  }
  double scale = 0.0;
  for (const double weight : own_weight_) scale += weight;
  std::vector<Eigen::LDLT<Block>> blocks(n);
  for (std::size_t i = 0; i < n; ++i) {
    Block block = Eigen::Map<const Block>(factor_[i].data());
    block.diagonal().array() += 1e-9 * std::max(block.trace(), 1e-30);
    blocks[i].compute(block);
  }
  const auto dot = [n](const std::vector<Vector6>& x, const std::vector<Vector6>& y) {
    double sum = 0.0;
    for (std::size_t i = 0; i < n; ++i) sum += ConstMap6(x[i].data()).dot(ConstMap6(y[i].data()));
    return sum;
  };
  const auto speed = [](const Row& r, const std::vector<Vector6>& x) {
    double s = ConstMap6(r.on_a.data()).dot(ConstMap6(x[r.a].data()));
    if (r.b >= 0) s += ConstMap6(r.on_b.data()).dot(ConstMap6(x[r.b].data()));
    return s;
  };
  const auto precondition = [&] {
    for (std::size_t i = 0; i < n; ++i)
      Map6(preconditioned_[i].data()) =
          blocks[i].solve(Eigen::Matrix<double, 6, 1>(ConstMap6(residual_[i].data())));
  };
  change_.assign(n, Vector6{});
  preconditioned_.resize(n), image_.resize(n);
  precondition();
  direction_ = preconditioned_;
  double product = dot(residual_, preconditioned_);
  const int max_iterations = 50 + 12 * static_cast<int>(n);
  bool converged = false;
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    converged = std::sqrt(dot(residual_, residual_)) <= kTolerance * scale;
    if (converged) break;
    std::ranges::fill(image_, Vector6{});
    for (const Row& r : rows_) {
      if (!is_free(r)) continue;
      const double impulse = r.weight * speed(r, direction_);
      Map6(image_[r.a].data()) += impulse * ConstMap6(r.on_a.data());
      if (r.b >= 0) Map6(image_[r.b].data()) += impulse * ConstMap6(r.on_b.data());
    }
    const double curvature = dot(direction_, image_);
    if (!(curvature > 0.0)) break;
    const double step = product / curvature;
    for (std::size_t i = 0; i < n; ++i) {
      Map6(change_[i].data()) += step * ConstMap6(direction_[i].data());
      Map6(residual_[i].data()) -= step * ConstMap6(image_[i].data());
    }
    precondition();
    const double next = dot(residual_, preconditioned_);
    const double ratio = next / product;
    product = next;
    for (std::size_t i = 0; i < n; ++i)
      Map6(direction_[i].data()) =
          ConstMap6(preconditioned_[i].data()) + ratio * ConstMap6(direction_[i].data()).eval();
  }
  if (!converged) return false;
  for (Row& r : rows_)
    if (is_free(r)) r.impulse += r.weight * speed(r, change_);
  return true;
}

}  // namespace smartsurf::world
