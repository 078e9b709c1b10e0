Code.require_file("../../support.exs", __DIR__)

defmodule Bridge.MixProject do
  use Mix.Project

  def project, do: Convoy.Support.project(:bridge, deps: [{:console, in_umbrella: true}])

  # Mix hides applications of OTP that are not listed. mochiweb serves, where it is.
  def application, do: [extra_applications: [:logger, :crypto, mochiweb: :optional]]
end
