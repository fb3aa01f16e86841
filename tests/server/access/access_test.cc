#include <gtest/gtest.h>

#include <string>

#include "server/access/admission_control.h"

namespace terrace::server {
namespace {

constexpr const char* kToken = "0123456789abcdef";
// As `printf 0123456789abcdef | sha256sum` prints it.
const std::string kHash = "9f9f5111f7b27a781f1f1ddde5ebc2dd2b796bfc7365c9c28b548e564176929f";

TEST(AccessPolicy, ATokenOpensItsDatasetsAndThePublicOnes) {
  const auto policy = AccessPolicy::Make({{"field team", kHash, {"maui"}, 0}}, {"earth"});
  const GrantPtr grant = policy.Find(kToken);
  ASSERT_NE(grant, nullptr);
  EXPECT_EQ(grant->name, "field team");
  EXPECT_TRUE(grant->Sees("maui") && grant->Sees("earth"));
  EXPECT_FALSE(grant->Sees("secret"));
  EXPECT_EQ(policy.Find(kHash), nullptr) << "the hash itself is no token";
  EXPECT_EQ(policy.Find(""), nullptr);
  EXPECT_FALSE(policy.anonymous()->Sees("maui"));
}

TEST(AccessPolicy, WithoutTokensEverybodySeesEverything) {
  const auto policy = AccessPolicy::Make({}, {});
  EXPECT_FALSE(policy.has_tokens());
  EXPECT_TRUE(policy.anonymous()->Sees("anything"));
}

}  // namespace
}  // namespace terrace::server
