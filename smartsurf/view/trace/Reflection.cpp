#include "smartsurf/view/trace/Reflection.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace smartsurf::view {
namespace {

using Vec = Eigen::Vector3f;

constexpr float kPi = std::numbers::pi_v<float>;
constexpr float kMinAlpha = 0.01F;
constexpr float kMinShare = 0.25F;  // of the samples; what mirrors show is brighter than what is diffuse

// Heitz 2014: of directions at this cosine, the share that microfacets hide is λ / (1 + λ).
float smith_lambda(float cosine, float alpha) {
  const float c2 = cosine * cosine;
  return 0.5F * (std::sqrt(1.0F + alpha * alpha * std::max(1.0F - c2, 0.0F) / std::max(c2, 1e-8F)) - 1.0F);
}

float ggx(float cosine, float alpha) {
  const float d = cosine * cosine * (alpha * alpha - 1.0F) + 1.0F;
  return alpha * alpha / (kPi * d * d);
}

}  // namespace

// Duff et al. 2017.
ShadingFrame::ShadingFrame(const Vec& n) : z(n) {
  const float sign = std::copysign(1.0F, n.z()), a = -1.0F / (sign + n.z()), b = n.x() * n.y() * a;
  x = {1.0F + sign * n.x() * n.x() * a, sign * b, -sign * n.x()};
  y = {b, sign + n.y() * n.y() * a, -n.y()};
}

Reflection::Reflection(const Vec& albedo, const Finish& finish, const Vec& out)
    : out_(out), diffuse_(albedo * (1.0F - finish[1])), alpha_(std::max(finish[0] * finish[0], kMinAlpha)) {
  out_.z() = std::max(out_.z(), 1e-4F);
  head_on_ = Vec::Constant(finish[2]) * (1.0F - finish[1]) + albedo * finish[1];
  grazing_ = head_on_.cwiseMax(1.0F - finish[0]);
  const float mirrored = fresnel(out_.z()).maxCoeff(), diffuse = diffuse_.maxCoeff() * (1.0F - mirrored);
  mirror_share_ = mirrored <= 0.0F ? 0.0F
                  : diffuse <= 0.0F
                      ? 1.0F
                      : std::clamp(mirrored / (mirrored + diffuse), kMinShare, 1.0F - kMinShare);
}

// Schlick's, as lit_material() in ShaderChunks.cpp has it.
Vec Reflection::fresnel(float cosine) const {
  const float rest = std::clamp(1.0F - cosine, 0.0F, 1.0F), rest2 = rest * rest;
  return head_on_ + (grazing_ - head_on_) * (rest2 * rest2 * rest);
}

Reflection::Value Reflection::evaluate(const Vec& in) const {
  Value value;
  if (in.z() <= 0.0F) return value;
  if (mirror_share_ > 0.0F) {
    const Vec half = (in + out_).normalized();
    const float d = ggx(half.z(), alpha_), hidden_out = smith_lambda(out_.z(), alpha_),
                hidden_in = smith_lambda(in.z(), alpha_);
    value.mirrored = fresnel(half.dot(out_)) * (d / (4.0F * out_.z() * (1.0F + hidden_out + hidden_in)));
    value.density = mirror_share_ * d / (4.0F * out_.z() * (1.0F + hidden_out));
  }
  value.density += (1.0F - mirror_share_) * in.z() / kPi;
  // Light reflected by the microfacets is lost to the diffuse part, on the way in and on the way out.
  value.all =
      value.mirrored +
      diffuse_.cwiseProduct((Vec::Ones() - fresnel(in.z())).cwiseProduct(Vec::Ones() - fresnel(out_.z()))) *
          (in.z() / kPi);
  return value;
}

Vec Reflection::sample(const Eigen::Vector2f& u, float choice) const {
  const float angle = 2.0F * kPi * u.y();
  if (choice >= mirror_share_) {
    const float r = std::sqrt(u.x());
    return {r * std::cos(angle), r * std::sin(angle), std::sqrt(std::max(1.0F - u.x(), 0.0F))};
  }
  // A visible microfacet (Dupuy and Benyoub 2023).
  const Vec stretched = Vec(alpha_ * out_.x(), alpha_ * out_.y(), out_.z()).normalized();
  const float z = (1.0F - u.x()) * (1.0F + stretched.z()) - stretched.z(),
              r = std::sqrt(std::clamp(1.0F - z * z, 0.0F, 1.0F));
  const Vec cap = Vec(r * std::cos(angle), r * std::sin(angle), z) + stretched;
  const Vec half = Vec(alpha_ * cap.x(), alpha_ * cap.y(), std::max(cap.z(), 1e-6F)).normalized();
  return 2.0F * half.dot(out_) * half - out_;
}

}  // namespace smartsurf::view
