#include "smoothing/systematic_errors.h"

#include <gtest/gtest.h>

namespace relocd {
namespace {

TEST(SystematicErrorsTest, DescribesThoseThatAreLookedFor) {
  SystematicErrors errors;
  errors.estimate << 0.0, 0.08, -0.02, 0.0005, 0.0;
  errors.covariance.diagonal() << 0.0, 1e-4, 1e-4, 1e-8, 0.0;
  EXPECT_EQ(Describe(errors), "");
  errors.prior_sigmas[2] = 0.02;
  EXPECT_EQ(Describe(errors), "odometry: misses -2.000 +- 1.000 % of the way\n");
  errors.prior_sigmas[3] = 0.005;
  errors.prior_sigmas[1] = 0.1;
  EXPECT_EQ(Describe(errors),
            "odometry: misses -2.000 +- 1.000 % of the way and 0.500 +- 0.100 mrad of the turn on "
            "each metre\n"
            "camera: looks 0.080 +- 0.010 s before the times that it gives\n");
}

}  // namespace
}  // namespace relocd
