Code.require_file("../../support.exs", __DIR__)

defmodule Console.MixProject do
  use Mix.Project

  def project,
    do:
      Convoy.Support.project(:console,
        deps: [{:lab, in_umbrella: true}, {:agents, in_umbrella: true}]
      )

  def application,
    do: [extra_applications: [:logger, :crypto] ++ for_tests(Mix.env()) ++ [mochiweb: :optional]]

  # Mix hides applications of OTP that are not listed. mochiweb serves the page, where it is. The tests read the
  # pictures' XML, and have a proxy with HTTPS.
  defp for_tests(:test), do: [:xmerl, :inets, :ssl]
  defp for_tests(_env), do: []
end
