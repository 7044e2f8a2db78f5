/* The closed loop of configs/mu_2017/corrected.yaml as one plain C program.
 *
 * What podusv is measured against, written the way a control engineer writes such a program by
 * hand: the scenario is fixed, its numbers are constants, the Gaussians of the network are summed
 * node by node. Symbols and equation numbers are those of docs/model.md.
 *
 *   closed_loop LAW REPEATS LOG_EVERY STEPS grid N_U N_V N_R WIDTH_U WIDTH_V WIDTH_R
 *   closed_loop LAW REPEATS LOG_EVERY STEPS list WIDTH_U WIDTH_V WIDTH_R < centres, one a line
 *
 * Prints the median time of the loop [s], the integral of the distance [m s], the last state.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define MAX_NODES 1024
#define MAX_STATES (6 + 4 + 2 * MAX_NODES)

typedef enum { ADAPTIVE_NEURAL, DSC, BACKSTEPPING, PID } Law;

typedef struct {
    double m11, m22, m23, m32, m33;
    double X_u, X_uu, X_uuu;
    double Y_v, Y_vv, Y_rv, Y_r, Y_vr, Y_rr;
    double N_v, N_vv, N_rv, N_r, N_vr, N_rr;
} Vessel;

typedef struct {
    double x, y, x_dot, y_dot, x_ddot, y_ddot;
} Target;

typedef struct {
    int count;
    double centre[MAX_NODES][3];
    double width[3];
} Network;

/* Everything that is logged besides time and state. */
typedef struct {
    Target target;
    double z_e, psi_d, psi_e, alpha_u, alpha_r, u_e, r_e, f_hat_u, f_hat_r;
    double demand_u, demand_r;
    double tau[3], b[3];
    double saturated;
} Signals;

/* Errors (18), (19) after folding, and what the laws need again. */
typedef struct {
    double distance, z_e, psi_d, psi_e, side;
    double cos_d, sin_d, cos_e, sin_e;
    double P, Q, w, alpha_u, alpha_r;
} Tracking;

static const Vessel vessel = {
    .m11 = 23.8 + 2.0, .m22 = 23.8 + 10.0, .m33 = 1.76 + 1.0,
    .X_u = -0.72, .X_uu = -1.32742, .X_uuu = -5.86643,
    .Y_v = -0.8896, .Y_vv = -36.47287,
    .N_r = -1.9, .N_rr = -0.75,
};

static const double k_ze = 0.1, k_psie = 0.1, standoff = 0.5;
static const double k_ue = 4.0, k_re = 40.0;
static const double Gamma_u = 100.0, Gamma_r = 100.0, sigma_u = 0.1, sigma_r = 0.1;
static const double gamma_u = 1000.0, gamma_r = 1000.0, sigma_bu = 0.01, sigma_br = 0.01;
static const double partial = 0.1;
static const double A_u = 5.0, A_r = 5.0;
static const double T_u = 0.2, T_r = 0.2;
static const double K_Pu = 1100.0, K_Iu = 10.0, K_Du = 90.0;
static const double K_Pr = 80.0, K_Ir = 1.0, K_Dr = 10.0, T_d = 0.1;
static const double surge_limit = 8.0, yaw_limit = 2.5;
static const double speed = 0.5, turn_from = 100.0, turn_rate = 0.03;
static const double h = 0.01;

/* Path (53), the second branch read as velocities: a line, then a circle. */
static Target path(double t)
{
    if (t <= turn_from)
        return (Target){.x = speed * t, .x_dot = speed};
    double radius = speed / turn_rate;
    double angle = turn_rate * (t - turn_from);
    double c = cos(angle), s = sin(angle);
    return (Target){
        .x = speed * turn_from + radius * s, .y = radius * (1.0 - c),
        .x_dot = speed * c, .y_dot = speed * s,
        .x_ddot = -speed * turn_rate * s, .y_ddot = speed * turn_rate * c,
    };
}

/* (52) */
static void disturbance(double t, double b[3])
{
    b[0] = 0.5 + 0.1 * sin(0.2 * t) + 0.3 * cos(0.5 * t);
    b[1] = 0.5 + 0.2 * sin(0.2 * t) + 0.1 * cos(0.4 * t);
    b[2] = 0.5 + 0.1 * sin(0.1 * t) + 0.1 * cos(0.2 * t);
}

static double surge_force(const Vessel *p, double u, double v, double r)
{
    return (p->m22 * v + p->m23 * r) * r + (p->X_u + p->X_uu * fabs(u) + p->X_uuu * u * u) * u;
}

static double sway_force(const Vessel *p, double u, double v, double r)
{
    return -p->m11 * u * r + (p->Y_v + p->Y_vv * fabs(v) + p->Y_rv * fabs(r)) * v
           + (p->Y_r + p->Y_vr * fabs(v) + p->Y_rr * fabs(r)) * r;
}

static double yaw_moment(const Vessel *p, double u, double v, double r)
{
    return p->m11 * u * v - (p->m22 * v + p->m23 * r) * u
           + (p->N_v + p->N_vv * fabs(v) + p->N_rv * fabs(r)) * v
           + (p->N_r + p->N_vr * fabs(v) + p->N_rr * fabs(r)) * r;
}

/* (3), (4) */
static void plant(const Vessel *p, const double *s, const double tau[3], const double b[3], double *ds)
{
    double c = cos(s[2]), sn = sin(s[2]);
    double u = s[3], v = s[4], r = s[5];
    ds[0] = u * c - v * sn;
    ds[1] = u * sn + v * c;
    ds[2] = r;
    double surge = surge_force(p, u, v, r) + tau[0] + b[0];
    double sway = sway_force(p, u, v, r) + tau[1] + b[1];
    double yaw = yaw_moment(p, u, v, r) + tau[2] + b[2];
    double determinant = p->m22 * p->m33 - p->m23 * p->m32;
    ds[3] = surge / p->m11;
    ds[4] = (p->m33 * sway - p->m23 * yaw) / determinant;
    ds[5] = (p->m22 * yaw - p->m32 * sway) / determinant;
}

/* Angle brought into (-pi, pi]. */
static double wrap(double angle)
{
    return angle - 2.0 * M_PI * ceil((angle - M_PI) / (2.0 * M_PI));
}

/* Errors (18), (19), folded jointly, and virtual controls (21), (30). */
static Tracking track(const double *s, const Target *d)
{
    Tracking e;
    double x_e = d->x - s[0], y_e = d->y - s[1];
    double u = s[3], v = s[4];
    e.distance = sqrt(x_e * x_e + y_e * y_e);
    e.psi_d = atan2(y_e, x_e);
    e.cos_d = cos(e.psi_d);
    e.sin_d = sin(e.psi_d);
    e.psi_e = wrap(e.psi_d - s[2]);
    e.side = 1.0;
    if (fabs(e.psi_e) >= 0.5 * M_PI) {
        e.psi_e += e.psi_e > 0.0 ? -M_PI : M_PI;
        e.side = -1.0;
    }
    e.cos_e = cos(e.psi_e);
    e.sin_e = sin(e.psi_e);
    e.z_e = e.side * (e.distance - standoff);
    e.P = e.side * (d->x_dot * e.cos_d + d->y_dot * e.sin_d);
    e.Q = e.side * (-d->x_dot * e.sin_d + d->y_dot * e.cos_d);
    e.w = e.side * (e.Q + u * e.sin_e - v * e.cos_e) / e.distance;
    e.alpha_u = (k_ze * e.z_e + e.P - v * e.sin_e) / e.cos_e;
    e.alpha_r = e.w + k_psie * e.psi_e;
    return e;
}

/* Node outputs (14). */
static void activate(const Network *net, double u, double v, double r, double *phi)
{
    double e_u = 0.5 / (net->width[0] * net->width[0]);
    double e_v = 0.5 / (net->width[1] * net->width[1]);
    double e_r = 0.5 / (net->width[2] * net->width[2]);
    for (int i = 0; i < net->count; i++) {
        double du = u - net->centre[i][0], dv = v - net->centre[i][1], dr = r - net->centre[i][2];
        phi[i] = exp(-(e_u * du * du + e_v * dv * dv + e_r * dr * dr));
    }
}

static double dot(int n, const double *a, const double *b)
{
    double sum = 0.0;
    for (int i = 0; i < n; i++)
        sum += a[i] * b[i];
    return sum;
}

/* alpha_u', for full backstepping. */
static double alpha_u_rate(const Vessel *p, const Tracking *e, const double *s, const Target *d)
{
    double u = s[3], v = s[4], r = s[5];
    double v_dot = sway_force(p, u, v, r) / p->m22;
    double z_e_dot = e->P - u * e->cos_e - v * e->sin_e;
    double along = e->side * (d->x_ddot * e->cos_d + d->y_ddot * e->sin_d);
    double swing = (e->w - r) * (e->alpha_u * e->sin_e - v * e->cos_e);
    return (k_ze * z_e_dot + along + e->Q * e->w - v_dot * e->sin_e + swing) / e->cos_e;
}

/* alpha_r' for a given surge force, for full backstepping. */
static double alpha_r_rate(const Vessel *p, const Tracking *e, const double *s, const Target *d,
                           double tau_u)
{
    double u = s[3], v = s[4], r = s[5];
    double u_dot = (surge_force(p, u, v, r) + tau_u) / p->m11;
    double v_dot = sway_force(p, u, v, r) / p->m22;
    double across = e->side * (-d->x_ddot * e->sin_d + d->y_ddot * e->cos_d);
    double z_e_dot = e->P - u * e->cos_e - v * e->sin_e;
    double swing = (u * e->cos_e + v * e->sin_e) * (e->w - r);
    double turn = across - e->P * e->w + u_dot * e->sin_e - v_dot * e->cos_e + swing - e->w * z_e_dot;
    return e->side * turn / e->distance + k_psie * (e->w - r);
}

/* A virtual control's filter: (22), (31) with B = A + |alpha|, or a first-order lag. */
static double filter_rate(Law law, double alpha, double beta, double A, double T)
{
    return law == DSC ? (alpha - beta) / T : (A + fabs(alpha)) * (alpha - beta);
}

/* (26)-(28), (35)-(37); memory is b_hat_u, b_hat_r, W_hat_u, W_hat_r, beta_u, beta_r. */
static void backstepping(Law law, const Vessel *p, const Network *net, const double *s,
                         double *ds, Signals *out)
{
    int n = net->count;
    const double *m = s + 6, *W_u = m + 2, *W_r = W_u + n, *beta = W_r + n;
    double *dm = ds + 6, *dW_u = dm + 2, *dW_r = dW_u + n, *dbeta = dW_r + n;
    double phi[MAX_NODES];
    double u = s[3], v = s[4], r = s[5];

    Tracking e = track(s, &out->target);
    activate(net, u, v, r, phi);
    double f_hat_u = dot(n, W_u, phi), f_hat_r = dot(n, W_r, phi);

    double beta_u = e.alpha_u, beta_u_dot;
    if (law == BACKSTEPPING) {
        beta_u_dot = alpha_u_rate(p, &e, s, &out->target);
    } else {
        beta_u = beta[0];
        beta_u_dot = dbeta[0] = filter_rate(law, e.alpha_u, beta[0], A_u, T_u);
    }
    double u_e = u - beta_u, phi_u = u_e / (4.0 * partial);
    out->demand_u = -k_ue * u_e - p->m11 * f_hat_u - m[0] * phi_u + p->m11 * beta_u_dot
                    + e.z_e * e.cos_e;

    double beta_r = e.alpha_r, beta_r_dot;
    if (law == BACKSTEPPING) {
        beta_r_dot = alpha_r_rate(p, &e, s, &out->target, out->demand_u);
    } else {
        beta_r = beta[1];
        beta_r_dot = dbeta[1] = filter_rate(law, e.alpha_r, beta[1], A_r, T_r);
    }
    double r_e = r - beta_r, phi_r = r_e / (4.0 * partial);
    out->demand_r = -k_re * r_e - p->m33 * f_hat_r - m[1] * phi_r + p->m33 * beta_r_dot + e.psi_e;

    dm[0] = gamma_u * (u_e * phi_u - sigma_bu * m[0]);
    dm[1] = gamma_r * (r_e * phi_r - sigma_br * m[1]);
    for (int i = 0; i < n; i++)
        dW_u[i] = Gamma_u * (u_e * p->m11 * phi[i] - sigma_u * W_u[i]);
    for (int i = 0; i < n; i++)
        dW_r[i] = Gamma_r * (r_e * p->m33 * phi[i] - sigma_r * W_r[i]);

    out->z_e = e.distance, out->psi_d = e.psi_d, out->psi_e = e.psi_e;
    out->alpha_u = e.alpha_u, out->alpha_r = e.alpha_r;
    out->u_e = u_e, out->r_e = r_e, out->f_hat_u = f_hat_u, out->f_hat_r = f_hat_r;
}

/* Memory is integral_u, integral_r, lag_u, lag_r. */
static void pid(const double *s, double *ds, Signals *out)
{
    const double *m = s + 6;
    double *dm = ds + 6;
    Tracking e = track(s, &out->target);
    double u_p = e.alpha_u - s[3], r_p = e.alpha_r - s[5];
    dm[0] = u_p;
    dm[1] = r_p;
    dm[2] = (u_p - m[2]) / T_d;
    dm[3] = (r_p - m[3]) / T_d;
    out->demand_u = K_Pu * u_p + K_Iu * m[0] + K_Du * dm[2];
    out->demand_r = K_Pr * r_p + K_Ir * m[1] + K_Dr * dm[3];
    out->z_e = e.distance, out->psi_d = e.psi_d, out->psi_e = e.psi_e;
    out->alpha_u = e.alpha_u, out->alpha_r = e.alpha_r;
    out->u_e = -u_p, out->r_e = -r_p;
}

static double clip(double x, double limit)
{
    return fmin(fmax(x, -limit), limit);
}

static void right_hand_side(Law law, const Network *net, double t, const double *s, double *ds,
                            Signals *out)
{
    out->target = path(t);
    disturbance(t, out->b);
    if (law == PID)
        pid(s, ds, out);
    else
        backstepping(law, &vessel, net, s, ds, out);
    out->tau[0] = clip(out->demand_u, surge_limit);
    out->tau[1] = 0.0;
    out->tau[2] = clip(out->demand_r, yaw_limit);
    out->saturated = out->tau[0] != out->demand_u || out->tau[2] != out->demand_r;
    plant(&vessel, s, out->tau, out->b, ds);
}

static int states(Law law, const Network *net)
{
    return law == PID ? 6 + 4 : 6 + 2 + 2 * net->count + (law == BACKSTEPPING ? 0 : 2);
}

/* At rest at (-10, -10); filters and lags start on what they follow. */
static void start(Law law, const Network *net, double *s)
{
    int n = states(law, net);
    memset(s, 0, n * sizeof *s);
    s[0] = s[1] = -10.0;
    Target target = path(0.0);
    Tracking e = track(s, &target);
    if (law != BACKSTEPPING) {
        s[n - 2] = e.alpha_u;
        s[n - 1] = e.alpha_r;
    }
}

/* Classical RK4 over `steps` steps; returns the integral of the distance. */
static double march(Law law, const Network *net, int steps, int log_every, double *s, double *log)
{
    static double k1[MAX_STATES], k2[MAX_STATES], k3[MAX_STATES], k4[MAX_STATES], y[MAX_STATES];
    int n = states(law, net);
    Signals signals = {0}, inner = {0};
    double iae = 0.0;
    for (int k = 0; k <= steps; k++) {
        double t = k * h;
        right_hand_side(law, net, t, s, k1, &signals);
        iae += (k == 0 || k == steps ? 0.5 * h : h) * signals.z_e;
        if (k % log_every == 0) {
            log[0] = t;
            memcpy(log + 1, s, n * sizeof *s);
            memcpy(log + 1 + n, &signals, sizeof signals);
            log += 1 + n + sizeof signals / sizeof *log;
        }
        if (k == steps)
            break;
        for (int i = 0; i < n; i++)
            y[i] = s[i] + 0.5 * h * k1[i];
        right_hand_side(law, net, t + 0.5 * h, y, k2, &inner);
        for (int i = 0; i < n; i++)
            y[i] = s[i] + 0.5 * h * k2[i];
        right_hand_side(law, net, t + 0.5 * h, y, k3, &inner);
        for (int i = 0; i < n; i++)
            y[i] = s[i] + h * k3[i];
        right_hand_side(law, net, t + h, y, k4, &inner);
        for (int i = 0; i < n; i++)
            s[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
    }
    return iae;
}

static double at(int count, int i, double low, double high)
{
    return count > 1 ? low + (high - low) * i / (count - 1) : (low + high) / 2.0;
}

static void make_grid(Network *net, int n_u, int n_v, int n_r)
{
    net->count = 0;
    for (int i = 0; i < n_u; i++)
        for (int j = 0; j < n_v; j++)
            for (int m = 0; m < n_r; m++) {
                double *c = net->centre[net->count++];
                c[0] = at(n_u, i, -1.0, 2.5);
                c[1] = at(n_v, j, -1.0, 1.0);
                c[2] = at(n_r, m, -1.0, 1.0);
            }
}

static void read_list(Network *net)
{
    net->count = 0;
    for (double c[3]; scanf("%lf %lf %lf", &c[0], &c[1], &c[2]) == 3 && net->count < MAX_NODES;)
        memcpy(net->centre[net->count++], c, sizeof c);
}

static int named(const char *name)
{
    const char *names[] = {"adaptive_neural", "dsc", "full_backstepping", "pid"};
    for (int i = 0; i < 4; i++)
        if (strcmp(name, names[i]) == 0)
            return i;
    return -1;
}

static double now(void)
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

static int wrong_usage(void)
{
    fprintf(stderr, "usage: closed_loop LAW REPEATS LOG_EVERY STEPS grid N N N W W W | list W W W\n");
    return 2;
}

int main(int argc, char **argv)
{
    static Network net;
    int listed = argc == 9 && strcmp(argv[5], "list") == 0;
    if (!listed && (argc != 12 || strcmp(argv[5], "grid") != 0))
        return wrong_usage();
    int law = named(argv[1]);
    int repeats = atoi(argv[2]), log_every = atoi(argv[3]), steps = atoi(argv[4]);
    if (law < 0 || repeats < 1 || log_every < 1 || steps < 1)
        return wrong_usage();
    if (listed)
        read_list(&net);
    else if (atoi(argv[6]) * atoi(argv[7]) * atoi(argv[8]) <= MAX_NODES)
        make_grid(&net, atoi(argv[6]), atoi(argv[7]), atoi(argv[8]));
    for (int i = 0; i < 3; i++)
        net.width[i] = atof(argv[(listed ? 6 : 9) + i]);

    int n = states(law, &net);
    size_t row = 1 + n + sizeof(Signals) / sizeof(double);
    double s[MAX_STATES], iae = 0.0;
    double *log = calloc(row * (steps / log_every + 1), sizeof *log);
    double *times = calloc(repeats, sizeof *times);
    if (!log || !times)
        return 5;
    for (int i = 0; i < repeats; i++) {
        start(law, &net, s);
        double began = now();
        iae = march(law, &net, steps, log_every, s, log);
        times[i] = now() - began;
    }
    qsort(times, repeats, sizeof *times, ascending);
    printf("%.9f\n%.17g\n", times[repeats / 2], iae);
    for (int i = 0; i < n; i++)
        printf("%.17g\n", s[i]);
    free(log);
    free(times);
    return 0;
}
