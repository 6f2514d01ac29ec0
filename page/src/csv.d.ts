// SPDX-License-Identifier: MIT
declare module "*.csv" {
  const text: string;
  export default text;
}
