// FNV-1a against its authors' test vectors.
#include "common/hash/Fnv.h"

#include <gtest/gtest.h>

namespace common {
namespace {

TEST(Fnv, MatchesItsAuthorsTestVectors) {
  EXPECT_EQ(fnv1a(""), 0xcbf29ce484222325U);
  EXPECT_EQ(fnv1a("a"), 0xaf63dc4c8601ec8cU);
  EXPECT_EQ(fnv1a("foobar"), 0x85944171f73967e8U);
  EXPECT_EQ(fnv1a("\xff"), fnv_mix(kFnvBasis, 0xff)) << "bytes have no sign";
}

}  // namespace
}  // namespace common
