/* Eight runs of configs/mu_2017/corrected.yaml side by side, as structure of arrays in plain C.
 *
 * What `simulate_many` is measured against: adaptive_neural with 27 nodes, another scale of the
 * disturbance in every run. Every loop over lanes is straight arithmetic, which the compiler makes
 * vector code of; there is no -ffast-math. Symbols and equation numbers are those of docs/model.md,
 * numbers those of closed_loop.c.
 *
 *   side_by_side REPEATS STEPS SCALE SCALE SCALE SCALE SCALE SCALE SCALE SCALE
 *
 * Prints the median time of all eight runs [s], then the integral of the distance [m s] of each.
 */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { LANES = 8, SIDE = 3, PLANE = SIDE * SIDE, NODES = SIDE * PLANE, PSI = 2, U = 3, V = 4, R = 5,
       B_HAT = 6, WEIGHTS = 8, BETA = WEIGHTS + 2 * NODES, STATES = BETA + 2 };
#define EACH_LANE _Pragma("omp simd") for (int l = 0; l < LANES; l++)

typedef double Lanes[LANES] __attribute__((aligned(64)));

static const double m11 = 25.8, m22 = 33.8, m33 = 2.76, X_u = -0.72, X_uu = -1.32742,
                    X_uuu = -5.86643, Y_v = -0.8896, Y_vv = -36.47287, N_r = -1.9, N_rr = -0.75;
static const double k_ze = 0.1, k_psie = 0.1, standoff = 0.5, k_ue = 4.0, k_re = 40.0;
static const double Gamma = 100.0, sigma = 0.1, gamma_b = 1000.0, sigma_b = 0.01, partial = 0.1;
static const double A = 5.0, surge_limit = 8.0, yaw_limit = 2.5;
static const double speed = 0.5, turn_from = 100.0, turn_rate = 0.03, h = 0.01;

static double E[18]; /* 1/n!, coefficients of all three series */
static double centre[3][SIDE], exponent[3];
static Lanes s[STATES], k1[STATES], k2[STATES], k3[STATES], k4[STATES], y[STATES], scale;

static inline double cubic(double x, double x2, double a, double b, double c, double d)
{
    return (a + x * b) + x2 * (c + x * d);
}

static inline double from_bits(int64_t bits)
{
    union { int64_t bits; double number; } both = {.bits = bits};
    return both.number;
}

static inline int64_t to_bits(double number)
{
    union { double number; int64_t bits; } both = {.number = number};
    return both.bits;
}

static const double ROUND = 0x1.8p52;

/* e^x for x <= 0. */
static inline double exponential(double x)
{
    double bound = x < -708.0 ? -708.0 : x;
    double z = bound * M_LOG2E + ROUND, n = z - ROUND;
    double r = (bound - n * 0x1.62e42feep-1) - n * 0x1.a39ef35793c76p-33;
    double r2 = r * r, r4 = r2 * r2;
    double series = cubic(r, r2, E[2], E[3], E[4], E[5])
                    + r4 * (cubic(r, r2, E[6], E[7], E[8], E[9])
                            + r4 * cubic(r, r2, E[10], E[11], E[12], E[13]));
    double power = from_bits((to_bits(z) + 1023) << 52);
    return x < -708.0 ? 0.0 : (1.0 + (r + r2 * series)) * power;
}

static inline void cos_sin(double angle, double *cosine, double *sine)
{
    double z = angle * M_2_PI + ROUND, n = z - ROUND;
    double r = ((angle - n * 0x1.921fb544p+0) - n * 0x1.0b4611a6p-34) - n * 0x1.3198a2e037073p-69;
    double q = -r * r, q2 = q * q, q4 = q2 * q2;
    double even = cubic(q, q2, E[2], E[4], E[6], E[8]) + q4 * cubic(q, q2, E[10], E[12], E[14], E[16]);
    double odd = cubic(q, q2, E[3], E[5], E[7], E[9]) + q4 * cubic(q, q2, E[11], E[13], E[15], E[17]);
    double c = 1.0 + q * even, sn = r + r * q * odd;
    int64_t quarters = to_bits(z);
    double turned_c = quarters & 1 ? -sn : c, turned_s = quarters & 1 ? c : sn;
    *cosine = quarters & 2 ? -turned_c : turned_c;
    *sine = quarters & 2 ? -turned_s : turned_s;
}

/* As podusv's; see core/elementary.py for the coefficients. */
static inline double arctangent(double up, double along)
{
    double a = fabs(up), b = fabs(along);
    double small = a > b ? b : a, large = a > b ? a : b;
    int64_t beyond = small > (M_SQRT2 - 1.0) * large;
    double above = beyond ? small - large : small, below = beyond ? small + large : large;
    double z = above / (below > 0.0 ? below : 1.0), w = z * z, w2 = w * w, w4 = w2 * w2;
    double series
        = cubic(w, w2, -0x1.5555555555555p-2, 0x1.9999999999953p-3, -0x1.249249248d7eep-3,
                0x1.c71c71c304b68p-4)
          + w4 * (cubic(w, w2, -0x1.745d165df3f95p-4, 0x1.3b1392d9e785cp-4,
                        -0x1.110e880a7a521p-4, 0x1.e19a13b9fc6dfp-5)
                  + w4 * cubic(w, w2, -0x1.ac7a938b69c94p-5, 0x1.74ddd408bb4c2p-5,
                               -0x1.1b33b923aa956p-5, 0x1.0ad36a455caffp-6));
    double angle = z + z * (w * series);
    angle = beyond ? M_PI_4 + angle : angle;
    angle = a > b ? M_PI_2 - angle : angle;
    angle = along < 0.0 ? M_PI - angle : angle;
    return up < 0.0 ? -angle : angle;
}

/* Path (53), the same in all runs: x, y and their first derivatives. */
static void path(double t, double target[4])
{
    double angle = turn_rate * (t - turn_from), radius = speed / turn_rate;
    int straight = t <= turn_from;
    target[0] = straight ? speed * t : speed * turn_from + radius * sin(angle);
    target[1] = straight ? 0.0 : radius * (1.0 - cos(angle));
    target[2] = straight ? speed : speed * cos(angle);
    target[3] = straight ? 0.0 : speed * sin(angle);
}

/* Node outputs (14): a Gaussian of u times one of (v, r). */
static void activate(Lanes *x, Lanes *phi)
{
    Lanes along[SIDE], plane[PLANE];
    for (int i = 0; i < SIDE; i++)
        EACH_LANE {
            double du = x[U][l] - centre[0][i];
            along[i][l] = exponential(-exponent[0] * du * du);
        }
    for (int i = 0; i < PLANE; i++)
        EACH_LANE {
            double dv = x[V][l] - centre[1][i / SIDE], dr = x[R][l] - centre[2][i % SIDE];
            plane[i][l] = exponential(-exponent[1] * dv * dv - exponent[2] * dr * dr);
        }
    for (int i = 0; i < NODES; i++)
        EACH_LANE phi[i][l] = along[i / PLANE][l] * plane[i % PLANE][l];
}

/* Rates of all states at time t, and the distance to the target. */
static void right_hand_side(double t, Lanes *x, Lanes *dx, double *distance)
{
    Lanes phi[NODES], f_u = {0}, f_r = {0}, drive_u, drive_r;
    double target[4], b_u, b_v, b_r;
    path(t, target);
    b_u = 0.5 + 0.1 * sin(0.2 * t) + 0.3 * cos(0.5 * t);
    b_v = 0.5 + 0.2 * sin(0.2 * t) + 0.1 * cos(0.4 * t);
    b_r = 0.5 + 0.1 * sin(0.1 * t) + 0.1 * cos(0.2 * t);
    activate(x, phi);
    for (int i = 0; i < NODES; i++)
        EACH_LANE {
            f_u[l] += x[WEIGHTS + i][l] * phi[i][l];
            f_r[l] += x[WEIGHTS + NODES + i][l] * phi[i][l];
        }
    EACH_LANE {
        double u = x[U][l], v = x[V][l], r = x[R][l], c, sn;
        double x_e = target[0] - x[0][l], y_e = target[1] - x[1][l];
        double d = sqrt(x_e * x_e + y_e * y_e), cos_d = x_e / d, sin_d = y_e / d;
        cos_sin(x[PSI][l], &c, &sn);
        /* Errors (18), (19), folded jointly, and virtual controls (21), (30). */
        double psi_e = arctangent(y_e, x_e) - x[PSI][l];
        psi_e -= 2.0 * M_PI * ceil((psi_e - M_PI) / (2.0 * M_PI));
        double cos_e = cos_d * c + sin_d * sn, sin_e = sin_d * c - cos_d * sn;
        double P = target[2] * cos_d + target[3] * sin_d, Q = target[3] * cos_d - target[2] * sin_d;
        double w = (Q + u * sin_e - v * cos_e) / d;
        int64_t turned = fabs(psi_e) >= M_PI_2;
        double half_turn = psi_e > 0.0 ? -M_PI : M_PI, side = turned ? -1.0 : 1.0;
        psi_e += turned ? half_turn : 0.0;
        cos_e *= side, sin_e *= side, P *= side;
        double z_e = side * (d - standoff);
        double alpha_u = (k_ze * z_e + P - v * sin_e) / cos_e, alpha_r = w + k_psie * psi_e;
        /* (22), (31), (26), (35) */
        double beta_u = x[BETA][l], beta_r = x[BETA + 1][l];
        double beta_u_dot = (A + fabs(alpha_u)) * (alpha_u - beta_u);
        double beta_r_dot = (A + fabs(alpha_r)) * (alpha_r - beta_r);
        double u_e = u - beta_u, r_e = r - beta_r;
        double phi_u = u_e / (4.0 * partial), phi_r = r_e / (4.0 * partial);
        double tau_u = -k_ue * u_e - m11 * f_u[l] - x[B_HAT][l] * phi_u + m11 * beta_u_dot + z_e * cos_e;
        double tau_r = -k_re * r_e - m33 * f_r[l] - x[B_HAT + 1][l] * phi_r + m33 * beta_r_dot + psi_e;
        tau_u = tau_u > surge_limit ? surge_limit : tau_u;
        tau_u = tau_u < -surge_limit ? -surge_limit : tau_u;
        tau_r = tau_r > yaw_limit ? yaw_limit : tau_r;
        tau_r = tau_r < -yaw_limit ? -yaw_limit : tau_r;
        /* (3), (4) */
        dx[0][l] = u * c - v * sn;
        dx[1][l] = u * sn + v * c;
        dx[PSI][l] = r;
        dx[U][l] = (m22 * v * r + (X_u + X_uu * fabs(u) + X_uuu * u * u) * u + tau_u + scale[l] * b_u) / m11;
        dx[V][l] = (-m11 * u * r + (Y_v + Y_vv * fabs(v)) * v + scale[l] * b_v) / m22;
        dx[R][l] = (m11 * u * v - m22 * v * u + (N_r + N_rr * fabs(r)) * r + tau_r + scale[l] * b_r) / m33;
        dx[B_HAT][l] = gamma_b * (u_e * phi_u - sigma_b * x[B_HAT][l]);
        dx[B_HAT + 1][l] = gamma_b * (r_e * phi_r - sigma_b * x[B_HAT + 1][l]);
        dx[BETA][l] = beta_u_dot, dx[BETA + 1][l] = beta_r_dot;
        drive_u[l] = u_e * m11, drive_r[l] = r_e * m33, distance[l] = d;
    }
    for (int i = 0; i < NODES; i++) /* (27), (36) */
        EACH_LANE {
            dx[WEIGHTS + i][l] = Gamma * (drive_u[l] * phi[i][l] - sigma * x[WEIGHTS + i][l]);
            dx[WEIGHTS + NODES + i][l]
                = Gamma * (drive_r[l] * phi[i][l] - sigma * x[WEIGHTS + NODES + i][l]);
        }
}

static void shifted(double by, Lanes *rate)
{
    for (int i = 0; i < STATES; i++)
        EACH_LANE y[i][l] = s[i][l] + by * rate[i][l];
}

/* Classical RK4; the integral of the distance of every run. */
static void march(int steps, double *iae)
{
    Lanes now, inner;
    for (int k = 0; k <= steps; k++) {
        double t = k * h, weight = k == 0 || k == steps ? 0.5 * h : h;
        right_hand_side(t, s, k1, now);
        EACH_LANE iae[l] += weight * now[l];
        if (k == steps)
            break;
        shifted(0.5 * h, k1);
        right_hand_side(t + 0.5 * h, y, k2, inner);
        shifted(0.5 * h, k2);
        right_hand_side(t + 0.5 * h, y, k3, inner);
        shifted(h, k3);
        right_hand_side(t + h, y, k4, inner);
        for (int i = 0; i < STATES; i++)
            EACH_LANE s[i][l] += h / 6.0 * (k1[i][l] + 2.0 * (k2[i][l] + k3[i][l]) + k4[i][l]);
    }
}

/* At rest at (-10, -10); the filters start on what they follow. */
static void start(void)
{
    double d = sqrt(200.0), P = speed * 10.0 / d, Q = -speed * 10.0 / d, psi_d = M_PI_4;
    memset(s, 0, sizeof s);
    EACH_LANE {
        s[0][l] = s[1][l] = -10.0;
        s[BETA][l] = (k_ze * (d - standoff) + P) / cos(psi_d);
        s[BETA + 1][l] = Q / d + k_psie * psi_d;
    }
}

static void prepare(void)
{
    const double low[3] = {-1.0, -1.0, -1.0}, high[3] = {2.5, 1.0, 1.0};
    E[0] = 1.0;
    for (int n = 1; n < 18; n++)
        E[n] = E[n - 1] / n;
    for (int axis = 0; axis < 3; axis++) {
        double spacing = (high[axis] - low[axis]) / (SIDE - 1), width = 0.7 * spacing;
        for (int i = 0; i < SIDE; i++)
            centre[axis][i] = low[axis] + spacing * i;
        exponent[axis] = 1.0 / (2.0 * width * width);
    }
}

static double processor_time(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return t.tv_sec + 1e-9 * t.tv_nsec;
}

static int ascending(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

int main(int argc, char **argv)
{
    int repeats = argc == 3 + LANES ? atoi(argv[1]) : 0, steps = repeats ? atoi(argv[2]) : 0;
    double times[100];
    Lanes iae;
    if (repeats < 1 || repeats > 100 || steps < 1) {
        fprintf(stderr, "usage: side_by_side REPEATS STEPS and %d scales\n", LANES);
        return 2;
    }
    for (int l = 0; l < LANES; l++)
        scale[l] = atof(argv[3 + l]);
    prepare();
    for (int i = 0; i < repeats; i++) {
        start();
        memset(iae, 0, sizeof iae);
        double began = processor_time();
        march(steps, iae);
        times[i] = processor_time() - began;
    }
    qsort(times, repeats, sizeof *times, ascending);
    printf("%.9f\n", times[repeats / 2]);
    for (int l = 0; l < LANES; l++)
        printf("%.17g\n", iae[l]);
    return 0;
}
