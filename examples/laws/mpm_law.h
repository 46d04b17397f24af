/* A constitutive law for mpm in a shared library: the interface, version 1.
 *
 * A deck names the library and gives the parameters of the law by their names:
 *
 *     materials:
 *       soil: {model: library, file: ./law.so, parameters: {young: 10e6, poisson: 0.3}, density: 1800}
 *
 * A law maps a trial elastic strain and the history variables at the start of a step to the Kirchhoff stress, the elastic
 * strain after the return mapping, the history variables at the end of the step, and the algorithmic tangent. It is
 * isotropic, three-dimensional, and formulated in the logarithmic elastic strain ½ ln b unless it says otherwise: a law of
 * small-strain plasticity then holds at finite strain without change. Tension is positive.
 *
 * Symmetric tensors are arrays of six components xx, yy, zz, yz, xz, xy. Shear components are those of the tensor, without
 * a factor of 2 or of the square root of 2. The tangent is an array of 36 numbers, row by row: tangent[6*i + j] is the
 * component D_ijkl of the fourth-order tensor d(stress)/d(trial strain) for the pairs i and j in that order. This is the
 * matrix that gives stresses from engineering shear strains: in shear, linear elasticity has the shear modulus G on
 * the diagonal.
 *
 * Functions are called from several threads at once, in any order and any number of times for the same step, since
 * iterations are repeated. They depend on their arguments alone, and write to their results alone: no static or global
 * variables (in Fortran: no SAVE, no COMMON, no initialised local variables), no files. Arrays never overlap. A law that
 * crashes takes the program with it; exceptions must not leave a function.
 *
 * Functions marked "optional" may be left out; what then holds is stated. The others are required.
 */
#ifndef MPM_LAW_H
#define MPM_LAW_H

#include <stdint.h>

/* The version of this interface. */
#define MPM_LAW_ABI 1

#if defined(_WIN32)
#define MPM_LAW_FUNCTION __declspec(dllexport)
#elif defined(__GNUC__)
#define MPM_LAW_FUNCTION __attribute__((visibility("default")))
#else
#define MPM_LAW_FUNCTION
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* Sizes of a law. */
struct mpm_sizes {
    int64_t size;         /* sizeof(struct mpm_sizes), by which the program checks that both sides mean the same */
    int64_t n_parameters; /* number of parameters, at most 1000 */
    int64_t n_history;    /* number of history variables, at most 1000 */
};

/* A parameter or a history variable. Texts are UTF-8, end with a zero byte, and stay valid while the program runs. A name
 * begins with a letter and consists of letters, digits and underscores. */
struct mpm_variable {
    const char *name;
    const char *unit; /* such as "stress"; "-" without unit */
    double initial;   /* initial value of a history variable; ignored for parameters */
};

/* The version of the interface that the library implements: MPM_LAW_ABI. */
MPM_LAW_FUNCTION int32_t mpm_law_abi(void);

/* Writes the sizes of the law. */
MPM_LAW_FUNCTION void mpm_law_sizes(struct mpm_sizes *sizes);

/* Describes a parameter, number 0 to n_parameters - 1. Values of parameters are passed in this order. Optional without
 * parameters. */
MPM_LAW_FUNCTION void mpm_law_parameter(int64_t number, struct mpm_variable *parameter);

/* Describes a history variable, number 0 to n_history - 1. Optional without history variables. */
MPM_LAW_FUNCTION void mpm_law_history(int64_t number, struct mpm_variable *variable);

/* The return mapping of a point from its trial elastic strain, which is finite. old_history holds the history variables at
 * the start of the step, and new_history a copy of them; the other arrays are results. Returns 0, or another number if the
 * law has no response: the step is then tried again with a smaller increment, and the number appears in the message if
 * that does not help. Results that are not finite also refuse the strain. */
MPM_LAW_FUNCTION int32_t mpm_law_update(const double *parameters, const double trial[6], const double *old_history,
                                        double *new_history, double stress[6], double elastic_strain[6],
                                        double tangent[36]);

/* Optional: a null pointer if the values of the parameters can be used, otherwise a sentence that says why not. Without
 * it, all finite values can. */
MPM_LAW_FUNCTION const char *mpm_law_refuse(const double *parameters);

/* Optional: the stored elastic energy per initial volume. Without it, half the product of stress and elastic strain, which
 * is exact for linear elasticity. Used for the columns of energy only. */
MPM_LAW_FUNCTION double mpm_law_energy(const double *parameters, const double elastic_strain[6], const double *history);

/* Optional: the plastic work per initial volume; 0 without it. Used for the columns of energy only. */
MPM_LAW_FUNCTION double mpm_law_plastic_work(const double *parameters, const double *history);

/* Optional: the elastic strain whose stress is `stress`, the inverse of the elastic law, whether or not the stress is
 * beyond yield. Returns 0, or another number if there is none. Bodies with an initial stress need it. */
MPM_LAW_FUNCTION int32_t mpm_law_elastic_strain(const double *parameters, const double stress[6],
                                                const double *history, double elastic_strain[6]);

/* Optional: adapts the history variables of a point to the elastic strain and the volume ratio J with which it begins, where
 * its body has an initial stress. Without it, they keep their initial values. */
MPM_LAW_FUNCTION void mpm_law_start(const double *parameters, const double elastic_strain[6], double volume_ratio,
                                    double *history);

/* Optional: 1 if the tangent has major symmetry with these parameters, 0 if not; 1 without it. Equations with a tangent
 * that is not symmetric cost about twice as much. */
MPM_LAW_FUNCTION int32_t mpm_law_tangent_is_symmetric(const double *parameters);

/* Optional: the strain measure of the law: 0 for the logarithmic strain ½ ln b, 1 for ½ (b - I); 0 without it. */
MPM_LAW_FUNCTION int32_t mpm_law_measure(void);

#ifdef __cplusplus
}
#endif

#endif
